import numpy as np

from fpid_pin.tuning import SearchSettings
from fpid_pin.tuning.search import Evolution


def made(seed, **changes):
    return Evolution(np.empty((0, 6)), 1, SearchSettings(**changes), seed)


def bowl(points):
    return ((points - 0.3) ** 2).sum(axis=1, keepdims=True)


def test_the_papers_settings_mean_what_they_say():
    crossed = mutated = offspring = 0
    for seed in range(20):
        # Without mutation: an offspring that is no parent's copy was crossed.
        evolution = made(seed, mutation=0.0)
        parents = evolution.ask()
        evolution.tell(bowl(parents))
        known = {p.tobytes() for p in parents}
        children = evolution.ask()
        crossed += sum(child.tobytes() not in known for child in children)
        # Without crossover: a coordinate that no parent has was mutated.
        evolution = made(seed, crossover=0.0)
        parents = evolution.ask()
        evolution.tell(bowl(parents))
        children = evolution.ask()
        mutated += int((~np.isin(children, parents)).sum())
        offspring += len(children)
    # Two parents that are one and the same come out of a crossover unchanged.
    assert 0.70 < crossed / offspring < 0.76
    assert 0.025 < mutated / (6 * offspring) < 0.035
