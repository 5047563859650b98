"""Births of a log with the genomes that it leaves out: bred again, ancestors first."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from evocity.errors import RunError, told
from evocity.genome import Genome
from evocity.store.again import MOST_BREEDINGS
from evocity.store.schema import Birth


def completed(
    run,
    births: Mapping[int, Birth],
    read: Callable[[Sequence[int]], Mapping[int, Birth]],
    rebreed: Callable[..., Genome] | None,
) -> dict[int, Birth]:
    """The ``births`` of a ``run``, by id, with all genomes. ``read`` reads others by id;
    ``rebreed`` breeds one of its parents' genomes, by the run's header and condensation, once for
    however many; None where the run was opened without.

    Raises ValueError and LookupError for a log that is damaged; `RunError` if one cannot be bred
    here, or is another than it was.
    """
    family = dict(births)
    for _ in range(MOST_BREEDINGS):
        lacking = {p for one in family.values() if one.left_out for p in one.parents} - {*family}
        if not lacking:
            break
        family |= read(sorted(lacking))
    counts = {one.id: one.again.breedings if one.left_out else 0 for one in family.values()}
    for birth in sorted(family.values(), key=lambda one: one.id):
        if birth.left_out:
            parents = [family[one] for one in birth.parents]
            known = all(one.id < birth.id and one.genome is not None for one in parents)
            if not known or counts[birth.id] != 1 + sum(counts[one.id] for one in parents):
                raise ValueError(f"individual {birth.id} cannot be bred again from its parents")
            genome = _same_again(run, birth, [one.genome for one in parents], rebreed)
            family[birth.id] = replace(birth, genome=genome, again=None)
    return {identifier: family[identifier] for identifier in births}


def _same_again(run, birth: Birth, parents: Sequence[Genome], rebreed) -> Genome:
    """The genome of a ``birth`` that the log leaves out, if it is the one that was bred."""
    what = f"{run.path}: individual {birth.id}, whose genome the log leaves out"
    if rebreed is None:
        raise RunError(
            what,
            "a run that was opened with what breeds it again",
            "open it by evocity.open_run(path)",
        )
    with_it = ", ".join(
        f"{name} {version}"
        for name, version in dict(run.provenance.get("versions", {})).items()
        if name in ("evocity", "numpy", "numba")
    )
    try:
        genome = rebreed(birth, parents, run.header, run.condensation)
    except Exception as error:  # of another package's operator too
        raise RunError(
            f"{what}, cannot be bred again ({told(error).splitlines()[0][:300]})",
            f"its operator, {birth.operator}, as it was in the run ({with_it})",
            "install what the run was bred with; if that is so, the folder is damaged: bring it "
            "back from a copy",
        ) from error
    if genome.digest != birth.digest:
        raise RunError(
            f"{what}, is another when it is bred again by {birth.operator}",
            f"the genome of hash {birth.digest}, as the run bred it ({with_it})",
            "open the run with these versions, on a machine like the one it was bred on; if that "
            "is so, the folder is damaged: bring it back from a copy",
        )
    return genome


__all__ = ["completed"]
