#!/usr/bin/env python3
"""Do stated probabilities mean what they say? Reads the claims that bench_mismatch and bench_mismatch_cases wrote with
--claims (case, name, probability, odds of the other names, gain, share left, credit, share of a freer shape, share of the
mismatch, odds of relatives), prints a reliability table, and
with --fit the numbers of core/diagnosis/evidence/odds.cpp that make these claims likeliest.

    tests/bench/mismatch_reliability.py claims.txt [...] [--fit]
"""
import argparse
import collections
import math


Claim = collections.namedtuple("Claim", "p others gain left credit shape share relatives")


def read(files):
    claims = []
    for file in files:
        with open(file, encoding="utf-8") as lines:
            for line in lines:
                claims.append(Claim(*(float(field) for field in line.split()[2:])))
    return claims


USUAL = (0.062, 0.315, 14.0, 0.285, 5e-4)


def odds(numbers, c):
    """Of another cause: `odds_of_another_cause` in core/diagnosis/evidence/odds.cpp."""
    at_100, slope, by_left, by_shape, ideal = numbers
    return (at_100 * (max(c.gain, 1.0) / 100.0) ** -slope + by_left * (c.left + c.shape)
            + by_shape * min(1.0, c.shape / 0.005) + (ideal / max(c.share, 1e-6) if c.share < 1.0 else 0.0))


def stated(numbers, c):
    return min(0.995, 1.0 / (1.0 + c.others + c.relatives + odds(numbers, c)))


def loss(numbers, claims):
    """-log likelihood; a relative counts half. A weak prior (one claim's worth each) keeps the numbers finite."""
    total = sum(0.5 * math.log(n / usual) ** 2 for n, usual in zip(numbers, USUAL))
    for c in claims:
        p = max(0.001, stated(numbers, c))
        total -= c.credit * math.log(p) + (1.0 - c.credit) * math.log(1.0 - p)
    return total


def fitted(claims):
    numbers, step = list(USUAL), 0.5
    best = loss(numbers, claims)
    while step > 0.01:
        moved = False
        for k in range(len(numbers)):
            for factor in (math.exp(step), math.exp(-step)):
                tried = list(numbers)
                tried[k] *= factor
                if (cost := loss(tried, claims)) < best:
                    numbers, best, moved = tried, cost, True
        step *= 1.0 if moved else 0.5
    return numbers


def table(claims, said_of):
    print("| said | claims | right name | right or a relative |\n| --- | --- | --- | --- |")
    edges = (0.0, 0.3, 0.6, 0.8, 0.9, 0.97, 1.01)
    off = [0.0, 0.0]  # mean distance of said and held, by bin: a relative wrong, a relative half right
    for low, high in zip(edges, edges[1:]):
        inside = [(p, c.credit) for p, c in zip(said_of, claims) if low <= p < high]
        if inside:
            said = sum(p for p, _ in inside) / len(inside)
            right, near = (sum(c >= least for _, c in inside) / len(inside) for least in (0.9, 0.4))
            print(f"| {said:.2f} | {len(inside)} | {right:.2f} | {near:.2f} |")
            off[0] += abs(said - right) * len(inside) / len(claims)
            off[1] += abs(said - 0.5 * (right + near)) * len(inside) / len(claims)
    brier = sum((p - (c.credit >= 0.9)) ** 2 for p, c in zip(said_of, claims)) / len(claims)
    wrong = [p for p, c in zip(said_of, claims) if c.credit == 0.0]
    print(f"{len(claims)} claims, Brier {brier:.4f}, said and held apart by {off[0]:.3f} ({off[1]:.3f} with a relative half right); "
          f"{len(wrong)} wrong names, {sum(p >= 0.9 for p in wrong)} of them with 0.9 or more")


def main():
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("claims", nargs="+")
    ask.add_argument("--fit", action="store_true", help="fit the numbers to every other claim, and show the others")
    given = ask.parse_args()
    claims = read(given.claims)
    table(claims, [c.p for c in claims])
    if given.fit:
        for first in (0, 1):
            numbers, others = fitted(claims[first::2]), claims[1 - first::2]
            print("at_100 = {:.3g}, slope = {:.3g}, by_left = {:.3g}, by_shape = {:.3g}, ideal = {:.3g}; on the other half:".format(*numbers))
            table(others, [stated(numbers, c) for c in others])
            table(others, [stated(USUAL, c) for c in others])


if __name__ == "__main__":
    main()
