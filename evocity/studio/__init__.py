"""Studio in the browser, for this machine and this user only: all births, live; picks with notes;
children of picks; new runs, from cities to a recipe to a running search.

- `server`: the server, from its socket to Ctrl-C
- `browser`: opening the browser; `connections`: places for the user and for strangers
- `guard`: the guard of every request, and the headers of every answer
- `routes`: the addresses and their answers; `desk_routes`: those of the desk; `request_fields`: the
  fields of requests
- `runs`: all runs, each by its number; `run_watcher`: the watcher of a run folder
- `tiles`: small pictures in the cache
- `birth_details`: the details of one birth, and births in order by how they differ
- `picks`: picks with notes and undo
- `children`: broods of picks; `child_evaluation`: their workers; `drawing_board`: locks and masks
  that a user draws; `kept_children`: a folder of kept children with a recipe
- `desk`: the recipe desk and its choices; `desk_maps`: its maps
- `subprocesses`: processes of studio; `desk_jobs`: the jobs of the desk in such a process
- `page`: plain ES modules and CSS without a build step; `evocity.viewer` shows the births

Studio writes picks, kept children and recipes of new runs. It executes no measure of a run that
began elsewhere; no text of a page becomes a path or names a file.
"""
