"""Make the README's picture anew: the viewer over a run, a hole as the locator sees it, the report.

    PYTHONPATH=tests python tests/overview_picture.py

Needs Chromium, for the report. Look at the result before it is committed.
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np
from drawn_pictures import Scene, made_sensor

from cell.metrology.locate.pair import locate_pair
from cell.report.picture import draw_pair

ROOT = Path(__file__).parents[1]
PICTURE = ROOT / "cell" / "pictures" / "overview.jpg"
HOLE = "QP4"  # one of the demo's two that are out of tolerance
WIDTH, GAP, LEFT = 1700, 14, 1034  # px
QUALITY = 88


def main() -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for part in ("jobs", "calibration"):
            shutil.copytree(ROOT / part, folder / part)
        run([sys.executable, "-m", "cell", "run", "jobs/demo.yaml", "--speed", "10"], folder, 1)
        run([sys.executable, "-m", "cell", "view", "logs", "--hole", HOLE, "--picture", "view.png"],
            folder, 0)
        below = beside(a_hole(), report_of(folder))
        whole = above(cv2.imread(str(folder / "view.png")), below)
    cv2.imwrite(str(PICTURE), whole, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])


def run(command: list[str], folder: Path, code: int) -> None:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != code:
        raise SystemExit(f"{' '.join(command)}: exit code {done.returncode}\n{done.stderr}")


def a_hole() -> np.ndarray:
    """A drawn hole in brushed sheet, and what the locator makes of it."""
    scene = Scene(seed=4, sensor=made_sensor((640, 576)), surface="brushed",
                  centre=(1.6, -0.4, 244.0), wall=60.0, behind=20.0)
    hole, stripe = scene.hole_image(), scene.stripe_image()
    located = locate_pair(hole, stripe, scene.sensor, scene.expected(), "joint")
    return cv2.imdecode(np.frombuffer(draw_pair(hole, stripe, located), np.uint8), cv2.IMREAD_COLOR)


def report_of(folder: Path) -> np.ndarray:
    """The top of the run's report, as a browser shows it."""
    (report,) = (folder / "logs").glob("*.html")
    run(["chromium", "--headless", "--no-sandbox", "--hide-scrollbars", "--disable-gpu",
         "--window-size=1000,900", f"--user-data-dir={folder / 'browser'}",
         f"--screenshot={folder / 'report.png'}", report.as_uri()], folder, 0)
    return cv2.imread(str(folder / "report.png"))


def beside(left: np.ndarray, right: np.ndarray) -> np.ndarray:
    """Two pictures side by side; of the right one as much as fits."""
    left = wide(left, LEFT)
    right = wide(right, WIDTH - GAP - LEFT)[:len(left)]
    whole = np.full((len(left), WIDTH, 3), 255, np.uint8)
    whole[:, :LEFT], whole[:len(right), LEFT + GAP:] = left, right
    return whole


def above(top: np.ndarray, below: np.ndarray) -> np.ndarray:
    """One picture above another."""
    return np.vstack([wide(top, WIDTH), np.full((GAP, WIDTH, 3), 255, np.uint8), below])


def wide(picture: np.ndarray, width: int) -> np.ndarray:
    height = round(len(picture) * width / picture.shape[1])
    return cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA)


if __name__ == "__main__":
    main()
