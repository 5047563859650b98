"""Imported for its effect: all kernels for the usual block are loaded.

The fork server imports it once, so that a worker which replaces a dead one is ready at once.
Kernels of another block are loaded by each worker.
"""

from evocity.search.warm import USUAL_BLOCK, warm_up

warm_up(USUAL_BLOCK)
