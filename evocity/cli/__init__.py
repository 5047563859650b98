"""The `evocity` command: a file per command; each parses, calls the library and prints.

- `recipe`: a first recipe for maps of your own
- `run`, `resume`: a search
- `steer`: `pick`, `reweight` and `stop`, commands to a run
- `refine`: an optimiser improves one individual
- `replay`: births of a run, recomputed
- `keep`: the individuals of a run that are worth keeping
- `status`: the state of a run, and its `report`; `studio`: runs in a browser
- `encode`, `decode`, `score`, `autosimilarity`, `show`: one map or genome
- `breed`, `grow`: a child of genomes or maps, a fabric of any size
- `scene`: a map or genome in three dimensions
- `library`: objects from real maps, for scenes
- `pattern`: a town drawn by a rule
- `listings`: `cities`, `operators` and `readers`
- `fitness`, `fitness_new`, `fitness_check`: measures, and your own
- `shape`: shapes without a city; `curve`, `curve_detail`: lines as curves with details;
  `surface`: ground as surfaces with details
- `shared`: what several commands need: `options`, `inputs`, `checks`, `terminal` for printing,
  `commands` for errors and exit codes, `search_progress`

Commands import heavy modules only when they need them: ``--help`` answers at once.
"""

import click

from evocity import __version__
from evocity.cli.autosimilarity import autosimilarity
from evocity.cli.breed import breed
from evocity.cli.curve import curve
from evocity.cli.decode import decode
from evocity.cli.encode import encode
from evocity.cli.fitness import fitness
from evocity.cli.grow import grow
from evocity.cli.keep import keep
from evocity.cli.library import library
from evocity.cli.listings import cities, operators, readers
from evocity.cli.pattern import pattern
from evocity.cli.recipe import recipe
from evocity.cli.refine import refine
from evocity.cli.replay import replay
from evocity.cli.resume import resume
from evocity.cli.run import run
from evocity.cli.scene import scene
from evocity.cli.score import score
from evocity.cli.shape import shape
from evocity.cli.shared.commands import Commands
from evocity.cli.show import show
from evocity.cli.status import report, status
from evocity.cli.steer import pick, reweight, stop
from evocity.cli.studio import studio
from evocity.cli.surface import surface


@click.group(
    cls=Commands,
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 100},
    epilog="""\b
Examples:
  evocity run                                    breed the bundled demonstration
  evocity encode lyon-1er -o lyon.parquet        turn a city into a genome
  evocity decode lyon.parquet -o lyon.png        turn the genome into a map

Exit codes: 0 done; 1 the run failed; 2 the input is at fault; 130 stopped by Ctrl-C.""",
)
@click.version_option(__version__, prog_name="evocity")
def main() -> None:
    """Breed city fabrics: encode districts as fractal genomes, combine the genomes, and measure the
    maps that the genomes decode to."""


_RUNS = (run, recipe, resume, pick, reweight, stop, refine, replay, status, report, keep, studio)
_MAPS = (encode, decode, breed, grow, score, autosimilarity, show, scene, library, pattern, cities)
for _command in (*_RUNS, *_MAPS, fitness, operators, readers, shape, curve, surface):
    main.add_command(_command)

__all__ = ["main"]
