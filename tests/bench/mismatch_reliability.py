#!/usr/bin/env python3
"""Do stated probabilities mean what they say? Reads the claims that bench_mismatch and bench_mismatch_cases wrote with
--claims (case, name, probability, odds of the other names, gain, share left, credit, share of a freer shape), prints a reliability table, and
with --fit the numbers of tools/diagnose/probability.hpp that make these claims likeliest.

    tests/bench/mismatch_reliability.py claims.txt [...] [--fit]
"""
import argparse
import math


def read(files):
    claims = []
    for file in files:
        with open(file, encoding="utf-8") as lines:
            for line in lines:
                p, others, gain, left, credit, shape = (float(field) for field in line.split()[2:])
                claims.append((p, others, gain, left, credit, shape))
    return claims


USUAL = (0.03, 0.5, 10.0, 0.5)


def odds(numbers, gain, left, shape):
    at_100, slope, by_left, by_shape = numbers
    return at_100 * (max(gain, 1.0) / 100.0) ** -slope + by_left * (left + shape) + (by_shape if shape > 0.0 else 0.0)


def loss(numbers, claims):
    """-log likelihood; a relative counts half. A weak prior (one claim's worth each) keeps the numbers finite."""
    total = sum(0.5 * math.log(n / usual) ** 2 for n, usual in zip(numbers, USUAL))
    for _, others, gain, left, credit, shape in claims:
        p = min(0.999, max(0.001, 1.0 / (1.0 + others + odds(numbers, gain, left, shape))))
        total -= credit * math.log(p) + (1.0 - credit) * math.log(1.0 - p)
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


def table(claims, stated):
    print("| said | claims | right name | right or a relative |\n| --- | --- | --- | --- |")
    edges = (0.0, 0.3, 0.6, 0.8, 0.9, 0.97, 1.01)
    for low, high in zip(edges, edges[1:]):
        inside = [(p, c[4]) for p, c in zip(stated, claims) if low <= p < high]
        if inside:
            said = sum(p for p, _ in inside) / len(inside)
            right, near = (sum(c >= least for _, c in inside) / len(inside) for least in (0.9, 0.4))
            print(f"| {said:.2f} | {len(inside)} | {right:.2f} | {near:.2f} |")
    brier = sum((p - (c[4] >= 0.9)) ** 2 for p, c in zip(stated, claims)) / len(claims)
    wrong = [p for p, c in zip(stated, claims) if c[4] == 0.0]
    print(f"{len(claims)} claims, Brier {brier:.4f}; {len(wrong)} wrong names, {sum(p >= 0.9 for p in wrong)} of them with 0.9 or more")


def main():
    ask = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ask.add_argument("claims", nargs="+")
    ask.add_argument("--fit", action="store_true", help="fit the numbers to these claims")
    given = ask.parse_args()
    claims = read(given.claims)
    table(claims, [c[0] for c in claims])
    if given.fit:
        numbers = fitted(claims)
        print("at_100 = {:.3g}, slope = {:.3g}, by_left = {:.3g}, by_shape = {:.3g}".format(*numbers))
        table(claims, [min(0.995, 1.0 / (1.0 + c[1] + odds(numbers, c[2], c[3], c[5]))) for c in claims])


if __name__ == "__main__":
    main()
