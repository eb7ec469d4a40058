import numpy as np

from fpid_pin.tuning.evolution import Evolution


def made(costs=1, **changes):
    settings = {"population": 60, "crossover": 0.75, "mutation": 0.03, "seed": 5} | changes
    return Evolution(np.empty((0, 6)), costs, **settings)


def bowls(points):
    return np.stack([((points - 0.3) ** 2).sum(axis=1), ((points - 0.7) ** 2).sum(axis=1)], axis=1)


def test_the_papers_settings_mean_what_they_say():
    crossed = mutated = offspring = 0
    for seed in range(20):
        # Without mutation: an offspring that is no parent's copy was crossed.
        evolution = made(mutation=0.0, seed=seed)
        parents = evolution.ask()
        evolution.tell(bowls(parents)[:, :1])
        known = {p.tobytes() for p in parents}
        children = evolution.ask()
        crossed += sum(child.tobytes() not in known for child in children)
        # Without crossover: a coordinate that no parent has was mutated.
        evolution = made(crossover=0.0, seed=seed)
        parents = evolution.ask()
        evolution.tell(bowls(parents)[:, :1])
        children = evolution.ask()
        mutated += int((~np.isin(children, parents)).sum())
        offspring += len(children)
    # Two parents that are one and the same come out of a crossover unchanged.
    assert 0.70 < crossed / offspring < 0.76
    assert 0.025 < mutated / (6 * offspring) < 0.035
