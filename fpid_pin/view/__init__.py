"""Seeing runs: replays in one file, live views, figures and reports.

Matplotlib and the web server are imported by the functions that need them, not with this package.
"""

from fpid_pin.view import plots
from fpid_pin.view.document import Page
from fpid_pin.view.live_session import LiveReport, live
from fpid_pin.view.playground_page import playground
from fpid_pin.view.plots import figures, plot
from fpid_pin.view.replay import export_html, play, show
from fpid_pin.view.report import report_html
from fpid_pin.view.style import save_figure

__all__ = [
    "LiveReport",
    "Page",
    "export_html",
    "figures",
    "live",
    "play",
    "playground",
    "plot",
    "plots",
    "report_html",
    "save_figure",
    "show",
]
