#!/usr/bin/env python3
"""Makes the pictures of the manual with heba itself: make_pictures.py PROGRAM. Needs Debian's python3-opencv and chromium."""

import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

PAGES = Path(__file__).resolve().parent
CONFIGS = PAGES.parents[1] / "configs"
BAD = ["motion.tilt=6 deg", "motion.spin=3 deg", "motion.depth=0", "motion.spread=0.05"]


def heba(program, *words):
    subprocess.run([program, *map(str, words)], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def save(name, image, quality=80):
    cv2.imwrite(str(PAGES / "pictures" / name), image, [cv2.IMWRITE_JPEG_QUALITY, quality])


def scaled(image, width):
    return cv2.resize(image, (width, image.shape[0] * width // image.shape[1]), interpolation=cv2.INTER_AREA)


def first_image(folder):
    return cv2.imread(str(sorted(folder.iterdir())[0]))


def sheet_of(folder, count=9, columns=3, width=300):
    """Returns the first images of a folder in rows."""
    images = [cv2.imread(str(file)) for file in sorted(folder.iterdir())[:count]]
    small = [scaled(image, width) for image in images]
    small = [cv2.copyMakeBorder(i, 2, 2, 2, 2, cv2.BORDER_CONSTANT, value=(255, 255, 255)) for i in small]
    return np.vstack([np.hstack(small[i : i + columns]) for i in range(0, count, columns)])


def main(program):
    (PAGES / "pictures").mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        for kind, settings in (("good", []), ("bad", BAD)):
            flags = [word for setting in settings for word in ("--set", setting)]
            heba(program, "simulate", CONFIGS / "captures/scene.yaml", "--set", "image.clutter=true", *flags, "--out", work / kind)
            save(f"{kind}_set.jpg", sheet_of(work / kind / "images"))
        heba(program, "simulate", CONFIGS / "sample_scene.yaml", "--out", work / "sample")
        save("sample_image.jpg", scaled(first_image(work / "sample/images"), 640))
        for name, grid in (
            ("coded_board", "rows: 8, columns: 11, spacing: 20 mm, dot_diameter: 6 mm"),
            ("apriltag_grid", "family: tag36h11, rows: 4, columns: 8, tag_size: 25 mm"),
        ):
            (work / "board.yaml").write_text(f"{{type: {name}, {grid}}}\n")
            heba(program, "target", work / "board.yaml", "--paper", "a4", "--out", work / "sheet.png", "--dpi", "75")
            save(f"sheet_{name}.png", cv2.imread(str(work / "sheet.png"), cv2.IMREAD_GRAYSCALE))
        heba(program, "run", work / "sample/config.yaml", "--out", work / "run")
        shot = work / "report.png"
        subprocess.run(
            ["chromium", "--headless", "--no-sandbox", "--hide-scrollbars", "--window-size=1280,1400", f"--screenshot={shot}",
             f"file://{work}/run/report.html"],
            check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )
        save("report.jpg", scaled(cv2.imread(str(shot)), 960), 75)
        overlay = work / "detections"
        heba(program, "detect", work / "sample/config.yaml", "--out", overlay)
        save("overlay.jpg", scaled(first_image(overlay / "overlays"), 640))


if __name__ == "__main__":
    main(sys.argv[1])
