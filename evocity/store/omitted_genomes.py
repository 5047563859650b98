"""Genomes that a log leaves out, bred again from their ancestors."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from evocity.errors import RunError, describe_error
from evocity.genome import Genome
from evocity.store.reconstruction import MOST_BREEDINGS
from evocity.store.schema import Birth


def completed(
    run,
    births: Mapping[int, Birth],
    read: Callable[[Sequence[int]], Mapping[int, Birth]],
    rebreed: Callable[..., Genome] | None,
) -> dict[int, Birth]:
    """Return the ``births`` of a ``run``, by id, with all genomes. ``read`` reads others by id;
    ``rebreed`` breeds one from its parents' genomes, by the run's header and condensation.

    Raises ValueError and LookupError for a damaged log; `RunError` if a genome cannot be bred here,
    or differs from the logged hash.
    """
    family = dict(births)
    for _ in range(MOST_BREEDINGS):
        lacking = {p for one in family.values() if one.left_out for p in one.parents} - {*family}
        if not lacking:
            break
        family |= read(sorted(lacking))
    counts = {
        one.id: one.reconstruction.breedings if one.left_out else 0 for one in family.values()
    }
    for birth in sorted(family.values(), key=lambda one: one.id):
        if birth.left_out:
            parents = [family[one] for one in birth.parents]
            known = all(one.id < birth.id and one.genome is not None for one in parents)
            if not known or counts[birth.id] != 1 + sum(counts[one.id] for one in parents):
                raise ValueError(f"individual {birth.id} cannot be bred again from its parents")
            genome = _bred_again(run, birth, [one.genome for one in parents], rebreed)
            family[birth.id] = replace(birth, genome=genome, reconstruction=None)
    return {identifier: family[identifier] for identifier in births}


def _bred_again(run, birth: Birth, parents: Sequence[Genome], rebreed) -> Genome:
    what = f"{run.path}: individual {birth.id}, whose genome the log leaves out"
    if rebreed is None:
        raise RunError(
            f"{run.path}: the log leaves out the genome of individual {birth.id}",
            "a run that can breed the genome again",
            "open the run with evocity.open_run(path)",
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
            f"{what}, cannot be bred again ({describe_error(error).splitlines()[0][:300]})",
            f"the operator {birth.operator} that the run used, with {with_it}",
            "install the versions that bred the run; if these versions are installed, the run "
            "folder is damaged: restore the folder from a backup",
        ) from error
    if genome.digest != birth.digest:
        raise RunError(
            f"{what}, gets a different genome when the operator {birth.operator} breeds again",
            f"the genome with the hash {birth.digest}, bred with {with_it}",
            "open the run with these versions on a similar machine; if these versions give this "
            "error, the run folder is damaged: restore the folder from a backup",
        )
    return genome
