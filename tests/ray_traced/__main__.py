"""Write rendered pairs as folders: `python -m ray_traced OUT --from 0 --to 50 [--invalid]`."""

import argparse
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import cv2

from ray_traced.folders import write_pair
from ray_traced.invalid import draw_invalid
from ray_traced.pairs import render
from ray_traced.scenes import draw_scene
from ray_traced.varied import vary


def make(folder, seed, invalid, varied):
    """Render the pair of a seed and write it."""
    cv2.setNumThreads(1)
    pair = render(draw_invalid(seed) if invalid else draw_scene(seed))
    write_pair(folder, seed, vary(pair, seed) if varied else pair)
    return seed


def main():
    """Read the command line and write the folders, on all processors."""
    parser = argparse.ArgumentParser(prog="python -m ray_traced", description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--from", dest="first", type=int, default=0)
    parser.add_argument("--to", dest="end", type=int, default=50, help="the first not written")
    parser.add_argument("--invalid", action="store_true", help="pairs that must be refused")
    parser.add_argument("--varied", action="store_true", help="gain, gamma, flips, JPEG")
    parser.add_argument("--processes", type=int, default=None)
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(asked.processes) as pool:
        jobs = [pool.submit(make, asked.out, seed, asked.invalid, asked.varied)
                for seed in range(asked.first, asked.end)]
        for job in jobs:
            print(job.result(), end=" ", flush=True)
    print()


if __name__ == "__main__":
    main()
