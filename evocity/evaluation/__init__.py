"""Evaluation: engines that breed and evaluate, in worker processes with deadlines or right here.

- `engine`: the interface `Engine`, and `Here`, which runs jobs in the calling process
- `worker_pool`: `Workers`, the pool of worker processes; `job_table`: its jobs; `worker_seat`: one
  worker as the main process sees it; `worker_start`, `fork_server`: starting and ending workers
- `worker`: what runs inside a worker process; `process_state`, `floating_point`, `output`: undoing
  what a measure did to it; `canary`: noticing what it did besides
- `frames`: messages to a worker; `kept_genomes`: genomes that it keeps; `answers`,
  `array_frames`, `genome_document`: messages from it
- `linux_processes`: processes and memory on Linux
- `evaluator`: breeding, checks and evaluation of one individual
- `compilation`, `kernel_warmup`: compiling and loading kernels before the first job
- `cluster`: evaluation on many machines
"""

from evocity.evaluation.engine import Engine, Here
from evocity.evaluation.worker_pool import Workers

__all__ = ["Engine", "Here", "Workers"]
