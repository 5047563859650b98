"""The `evocity` command: one file a command; each parses, calls the library and prints.

- `recipe`: a recipe to begin from, for anyone's cities
- `run`, `resume`: a search, shown while it goes on by `searching`
- `asking`: `pick`, `reweight`, `stop`, what is asked of a run that goes on
- `refine`: one individual of a run made better by an optimiser
- `replay`: births of a run recomputed
- `keep`: which of a run are worth keeping
- `status`, `report`: a run, finished or not; `studio`: it in a browser
- `encode`, `decode`, `score`, `autosimilarity`, `show`: one map or genome
- `breed`, `grow`: a child of genomes or maps, a fabric of any size
- `scene`: a map or genome in three dimensions
- `library`: objects of real maps, to stand in scenes
- `pattern`: a town drawn by a rule
- `cities`, `operators`, `readers`: what there is
- `fitness`: the measures there are; `fitness_new`, `fitness_check`, `fitness_bench`: one's own;
  `trials`: what they are tried on
- `given`: what a word on the command line stands for: a map, a genome, a run
- `parents`, `settings`: what is bred, maps included; what ``--set key=value`` means
- `shape`: shapes without any city; `curve`, `detailing`: lines as curves with details
- `common`: options, checks, messages and printing that several commands share

Nothing heavy is imported before a command needs it: ``--help`` answers at once.
"""

import click

from evocity import __version__
from evocity.cli.asking import pick, reweight, stop
from evocity.cli.autosimilarity import autosimilarity
from evocity.cli.breed import breed
from evocity.cli.cities import cities
from evocity.cli.common import Commands
from evocity.cli.curve import curve
from evocity.cli.decode import decode
from evocity.cli.encode import encode
from evocity.cli.fitness import fitness
from evocity.cli.grow import grow
from evocity.cli.keep import keep
from evocity.cli.library import library
from evocity.cli.operators import operators
from evocity.cli.pattern import pattern
from evocity.cli.readers import readers
from evocity.cli.recipe import recipe
from evocity.cli.refine import refine
from evocity.cli.replay import replay
from evocity.cli.report import report
from evocity.cli.resume import resume
from evocity.cli.run import run
from evocity.cli.scene import scene
from evocity.cli.score import score
from evocity.cli.shape import shape
from evocity.cli.show import show
from evocity.cli.status import status
from evocity.cli.studio import studio


@click.group(
    cls=Commands,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="""\b
Examples:
  evocity run                                    breed the bundled demonstration
  evocity encode lyon-1er -o lyon.parquet        a city becomes a genome
  evocity decode lyon.parquet -o lyon.png        and a city again

Exit codes: 0 done; 1 the run failed; 2 the input is at fault; 130 stopped by Ctrl-C.""",
)
@click.version_option(__version__, prog_name="evocity")
def main() -> None:
    """Breed city fabrics: districts become fractal genomes, are crossed, decoded and measured."""


for _command in (
    run,
    recipe,
    resume,
    pick,
    reweight,
    stop,
    refine,
    replay,
    status,
    report,
    keep,
    studio,
    encode,
    decode,
    breed,
    grow,
    score,
    autosimilarity,
    show,
    scene,
    library,
    pattern,
    cities,
    fitness,
    operators,
    readers,
    shape,
    curve,
):
    main.add_command(_command)

__all__ = ["main"]
