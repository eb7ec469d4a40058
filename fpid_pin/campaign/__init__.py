"""Robustness campaigns: the same controllers on thousands of other plants, all recorded."""

from fpid_pin.campaign.data import CampaignData, Success, export
from fpid_pin.campaign.driver import Replay, attack, load, replay, run
from fpid_pin.campaign.report import report_html
from fpid_pin.campaign.study import (
    Choices,
    Distribution,
    LogUniform,
    Normal,
    Scenarios,
    Study,
    Uniform,
)
from fpid_pin.simulation.workers import dask_executor, local_cluster

__all__ = [
    "CampaignData",
    "Choices",
    "Distribution",
    "LogUniform",
    "Normal",
    "Replay",
    "Scenarios",
    "Study",
    "Success",
    "Uniform",
    "attack",
    "dask_executor",
    "export",
    "load",
    "local_cluster",
    "replay",
    "report_html",
    "run",
]
