"""`evocity recipe new`, and what `run` says of bounds that no parent keeps."""

from cli_tools import call, refused, write_recipe

#: Of what children have of their sources, too little for a bound of .5.
KIN = """
import evocity

@evocity.fitness(goal="max", range=(0, 1))
def kin(city, genome, sources):
    return 0.25 + 0.125 * genome.parent[0]
"""


# -- bounds that no parent keeps ---------------------------------------------------------------


def test_run_tells_of_a_bound_that_no_parent_keeps_before_the_first_birth(tmp_path):
    fitness = 'name = "alignment"\n[[fitness]]\nname = "gsi"\nmax = 0.05'
    path = write_recipe(tmp_path, fitness=fitness)
    told = call("run", path, "--out", tmp_path / "run").stderr
    first = told.index("Note: no parent's own code keeps gsi ≤ 0.05: left ")
    assert told.index("encoding right …") < first < told.index("generation 0/2")


def test_run_refuses_a_guard_that_no_parent_keeps(tmp_path):
    fitness = 'name = "alignment"\n[[fitness]]\nfile = "kin.py"\nmin = 0.5'
    (tmp_path / "kin.py").write_text(KIN)
    path = write_recipe(tmp_path, fitness=fitness)
    says = "no parent's own code keeps kin ≥ 0.5: left 0.25, right 0.375"
    message = refused(tmp_path, "run", path, "--out", tmp_path / "run", says=says)
    assert "what to do: write min = 0.375 for kin" in message
