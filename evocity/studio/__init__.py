"""Runs in the browser: every birth, live; picks with notes; children of picks; new runs, from
cities to a recipe to a night. For this machine and this user alone.

- `serving`: the server's life, from its socket to Ctrl-C
- `guard`: who is answered at all; what every answer says
- `answers`: which address is answered by what; `asked`: what requests may ask for
- `files`: the page's own files, in memory
- `runs`: which runs there are, each by its number
- `watched`: a run folder while one looks at it; `tiles`: its small pictures, kept for this user
- `one`: all that is told of one birth
- `comparing`: births in order by how they differ
- `picks`: births that a user picked, with notes and undo
- `breeding`: children of picks; `measuring`: who breeds and measures them; `keeping`: those that
  are kept, with a recipe that goes on from them
- `desk`: from maps to a run that goes on; `begins`: its addresses; `maps`: those on it, a user's
  files among them; `resuming`: a run that is stopped, or taken up
- `apart`: processes beside the server; `errands`: what they do for the desk
- `page`: plain ES modules and CSS without a build step; births are shown by `evocity.viewer`

It writes picks, what a user keeps, and recipes of runs that a user begins; no measure of a
stranger's run is executed, and no word of a page becomes a path or names a file.
"""
