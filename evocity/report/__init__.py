"""What a run shows: a self-contained HTML report, and a sheet of pictures.

facts      what a report tells, gathered from a run folder
failures   why births failed, and how many repeat each other, which differ when replayed
pictures   genomes as pictures on one scale of heights; the contact sheet
grid       the grid of a run of MAP-Elites, a map in each filled cell
islands    how good each island is, who lives where, who moved
plots      scatter plots and curves as inline SVG
gallery    a card for each individual: picture, measures, lineage
html       the page
"""

from evocity.report.facts import Facts
from evocity.report.failures import differing, differing_told, failures, repeated, unrecorded
from evocity.report.grid import grid_picture, run_picture
from evocity.report.html import write_report
from evocity.report.pictures import contact_sheet

__all__ = [
    "Facts",
    "contact_sheet",
    "differing",
    "differing_told",
    "failures",
    "grid_picture",
    "repeated",
    "run_picture",
    "unrecorded",
    "write_report",
]
