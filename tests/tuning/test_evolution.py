import numpy as np
import pytest

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


@pytest.mark.parametrize("costs", [1, 2])
def test_a_restored_state_goes_on_to_the_last_bit(costs):
    whole, first = made(costs), made(costs)
    for evolution in (whole, first):
        for _ in range(4):
            evolution.tell(bowls(evolution.ask())[:, :costs])
    second = made(costs, seed=99)
    second.restore(first.state())
    for _ in range(6):
        ours, theirs = whole.ask(), second.ask()
        assert np.array_equal(ours, theirs)
        whole.tell(bowls(ours)[:, :costs])
        second.tell(bowls(theirs)[:, :costs])
    assert np.array_equal(whole.points, second.points)
    assert np.array_equal(whole.costs, second.costs)


@pytest.mark.parametrize("costs", [1, 2])
def test_a_population_of_which_half_diverges_still_improves(costs):
    evolution, bests = made(costs), []
    for _ in range(25):
        points = evolution.ask()
        told = bowls(points)[:, :costs]
        told[points[:, 0] > 0.5] = np.inf
        evolution.tell(told)
        bests.append(evolution.costs[:, 0].min())
    assert np.isfinite(evolution.costs).all()
    assert (evolution.points[:, 0] <= 0.5).all()
    assert bests[-1] < bests[0] / 2
