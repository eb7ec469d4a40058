"""Campaigns by formula: what they say is known beforehand."""

import numpy as np

from fpid_pin.campaign.data import METRICS, CampaignData


def campaign(errors, samples=None, *, names=None, outcome=None, labels=None, title="made", seed=0):
    """Return a campaign with these RMS errors, (runs, controllers); NaN: diverged."""
    errors = np.asarray(errors, dtype=float)
    runs, columns = errors.shape
    samples = np.zeros((runs, 0)) if samples is None else np.asarray(samples, dtype=float)
    labels = labels or tuple(f"p{k}" for k in range(samples.shape[1]))
    if outcome is None:
        outcome = np.where(np.isnan(errors), "diverged", "completed")
    return CampaignData(
        title, seed, names or tuple("ABCDEFGH"[:columns]), labels, ("kg",) * len(labels), samples,
        outcome, np.where(np.isnan(errors), "speed 2e3 rad/s", ""),
        {name: errors * scale for scale, name in enumerate(METRICS, start=1)},
    )  # fmt: skip


def arms(runs, names, seed=0):
    """Return a campaign that looks like one of arms: heavy payloads are lost."""
    rng = np.random.default_rng(seed)
    x = rng.random((runs, 3)) * (2.0, 3.0, 0.005)
    scale = np.linspace(1.0, 3.0, len(names))
    errors = 0.01 * scale * np.exp(rng.normal(0.0, 0.3, (runs, len(names)))) * (1.0 + x[:, :1])
    errors[x[:, :1] + rng.normal(0.0, 0.1, errors.shape) > 2.1 - 0.2 * scale] = np.nan
    return campaign(
        errors, x, names=names, labels=("payload", "viscous_friction.0", "delay"), seed=seed
    )
