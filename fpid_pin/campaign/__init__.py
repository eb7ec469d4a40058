"""Robustness campaigns: the same controllers on thousands of other plants, all recorded."""

from fpid_pin.campaign.cluster import dask_executor, local_cluster
from fpid_pin.campaign.data import CampaignData, Success, export
from fpid_pin.campaign.driver import Replay, load, replay, run
from fpid_pin.campaign.report import report_html
from fpid_pin.campaign.study import Scenarios, Study
from fpid_pin.campaign.uncertain import Choices, Distribution, LogUniform, Normal, Uniform
from fpid_pin.campaign.worst_plant import attack

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
