"""Moves a second of simanneal (PyPI) on the instance that `cargo bench --bench annealers -- --export FILE` wrote.

    pip install simanneal==0.5.0 numpy
    python benches/peers/annealer_simanneal.py FILE [MOVES]

Two ways to write the peer: the cost recomputed with numpy for every move, and the sample values kept in the state and
changed by two columns, so that the comparison is with the faster one. Same swaps, same geometric cooling. Times are
processor times; run with OPENBLAS_NUM_THREADS=1, because coilwright's are of one thread as well.
"""

import random
import sys
import time

import numpy as np
from simanneal import Annealer

DEG_PER_H = 180.0 / np.pi * 3600.0


def read(path):
    numbers = np.fromfile(path, dtype="<f8")
    layers, samples = int(numbers[0]), int(numbers[1])
    return numbers[2], numbers[3], numbers[4:].reshape(layers, samples)


class Recomputed(Annealer):
    copy_strategy = "slice"

    def move(self):
        i, j = random.sample(range(len(self.state)), 2)
        self.state[i], self.state[j] = self.state[j], self.state[i]

    def energy(self):
        weights = 2.0 * np.array(self.state) - 1.0 - len(self.state)
        return np.abs(weights @ RESPONSES).max()


class Incremental(Annealer):
    """The state is (segments, values); `move` returns the change of energy, so simanneal does not call `energy`."""

    def copy_state(self, state):
        return (list(state[0]), state[1])

    def move(self):
        segments, values = self.state
        i, j = random.sample(range(len(segments)), 2)
        change = 2.0 * (segments[j] - segments[i])
        before = np.abs(values).max() if self.cached is not values else self.cached_max
        after = values + change * (RESPONSES[i] - RESPONSES[j])
        segments[i], segments[j] = segments[j], segments[i]
        self.state = (segments, after)
        largest = np.abs(after).max()
        self.cached, self.cached_max = after, largest
        return largest - before

    cached = None
    cached_max = 0.0

    def energy(self):
        return np.abs(self.state[1]).max()


def run(name, annealer, moves, hot, cold):
    annealer.Tmax, annealer.Tmin, annealer.steps, annealer.updates = hot, cold, moves, 0
    started = time.process_time()
    _, best = annealer.anneal()
    seconds = time.process_time() - started
    print(f"{name:<34} {moves:>10} moves {seconds:>8.3f} s {moves / seconds:>12.0f} moves/s  best {best * DEG_PER_H:.5f} deg/h")


if __name__ == "__main__":
    hot, cold, RESPONSES = read(sys.argv[1])
    moves = int(sys.argv[2]) if len(sys.argv) > 2 else 20_000
    random.seed(1)
    start = list(range(1, RESPONSES.shape[0] + 1))
    random.shuffle(start)
    run("simanneal 0.5.0, recomputed", Recomputed(list(start)), moves, hot, cold)
    values = (2.0 * np.array(start) - 1.0 - len(start)) @ RESPONSES
    run("simanneal 0.5.0, incremental", Incremental((list(start), values)), moves, hot, cold)
