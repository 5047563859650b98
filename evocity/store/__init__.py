"""A run on disk: births and membership in Parquet, and the reading of them.

- `open_run`: a run folder, read only, safe on a stranger's folder and while the run goes on
- `RunWriter`: creates a run folder, or takes one up again, and adds whole generations to it
- `Behind`: has a writer write while the next generation is bred
- `Anew`: the log of a run written anew under another header, beside the old one
- `set_aside`: moves damaged files at the end of a run away, so that it can go on
- `Birth`, `Member`, `Header`: one born individual, one living one, what all births share
- `Again`: how a birth is bred once more whose genome the log leaves out
- `Thumbnails`: how births are kept as small maps
- `Source`: a source city and its genome, as the run started from them
- `append_command`, `read_commands`: what other processes ask of a run that goes on
- `environment`, `hash_of_map`, `hash_of_mask`, `hash_of_file`: what provenance records
"""

from evocity.store.again import GENOMES, MOST_BREEDINGS, Again, generator_at, state_of
from evocity.store.anew import Anew
from evocity.store.behind import Behind
from evocity.store.commands import append_command, read_commands
from evocity.store.membership import Member
from evocity.store.provenance import (
    environment,
    hash_of_file,
    hash_of_map,
    hash_of_mask,
    hash_of_text,
)
from evocity.store.run import Run, open_run
from evocity.store.schema import SCHEMA_VERSIONS, STATUSES, Birth, Header
from evocity.store.sources import Source
from evocity.store.thumbnails import Thumbnails
from evocity.store.writer import RunWriter, refuse_existing, set_aside

__all__ = [
    "GENOMES",
    "MOST_BREEDINGS",
    "SCHEMA_VERSIONS",
    "STATUSES",
    "Again",
    "Anew",
    "Behind",
    "Birth",
    "Header",
    "Member",
    "Run",
    "RunWriter",
    "Source",
    "Thumbnails",
    "append_command",
    "environment",
    "generator_at",
    "hash_of_file",
    "hash_of_map",
    "hash_of_mask",
    "hash_of_text",
    "open_run",
    "read_commands",
    "refuse_existing",
    "set_aside",
    "state_of",
]
