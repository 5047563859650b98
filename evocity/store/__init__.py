"""Run folders on disk: births and membership in Parquet, provenance, sources, events.

- `RunLog`: reads a run folder; safe on a stranger's folder and while the run goes on
- `RunWriter`, `BackgroundWriter`, `LogRewrite`: write generations, in a thread, under a new header
- `set_aside`: moves damaged files of a run, and all after them, away, so that it can go on
- `Birth`, `Member`, `Header`, `Source`, `Thumbnails`, `Reconstruction`: the parts of a log
- `append_command`, `read_commands`: requests of other processes to a run that goes on
- `environment`, `hash_of_map`, `hash_of_mask`, `hash_of_file`: entries of provenance
"""

from evocity.store.background_writer import BackgroundWriter
from evocity.store.events import append_command, read_commands
from evocity.store.membership import Member
from evocity.store.provenance import (
    environment,
    hash_of_file,
    hash_of_map,
    hash_of_mask,
    hash_of_text,
)
from evocity.store.reconstruction import (
    GENOMES,
    MOST_BREEDINGS,
    Reconstruction,
    generator_at,
    state_of,
)
from evocity.store.rewrite import LogRewrite
from evocity.store.run_log import RunLog
from evocity.store.schema import SCHEMA_VERSIONS, STATUSES, Birth, Header
from evocity.store.sources import Source
from evocity.store.thumbnails import Thumbnails
from evocity.store.writer import RunWriter, refuse_existing, set_aside

__all__ = [
    "GENOMES",
    "MOST_BREEDINGS",
    "SCHEMA_VERSIONS",
    "STATUSES",
    "BackgroundWriter",
    "Birth",
    "Header",
    "LogRewrite",
    "Member",
    "Reconstruction",
    "RunLog",
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
    "read_commands",
    "refuse_existing",
    "set_aside",
    "state_of",
]
