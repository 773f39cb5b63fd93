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
PLANNED = """setup: eye_in_hand
target: {type: chessboard, rows: 6, columns: 9, square: 25 mm}
robot: {model: ur5e}
plan:
  hand_eye: {translation: [0 mm, 60 mm, 50 mm]}
  board: {translation: [500 mm, 50 mm, 0 mm], rpy: [180 deg, 0 deg, 30 deg]}
  workspace: {box: [[200 mm, -300 mm, 200 mm], [800 mm, 400 mm, 900 mm]]}
  lens: {focal_length: 8 mm, pixel: 3.45 um, image_size: [1920, 1200]}
"""
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


def screenshot(page, width, height, box=None):
    """Returns the top of a page as an image; `box` cuts out x, y, width and height."""
    with tempfile.TemporaryDirectory() as name:
        shot = Path(name) / "page.png"
        subprocess.run(
            ["chromium", "--headless", "--no-sandbox", "--hide-scrollbars", f"--window-size={width},{height}", f"--screenshot={shot}",
             f"file://{page}"],
            check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )
        image = cv2.imread(str(shot))
    return image if box is None else image[box[1] : box[1] + box[3], box[0] : box[0] + box[2]]


def figure_of(page, view, work, width=620, height=470):
    """Returns one figure of a page, drawn alone."""
    text = page.read_text()
    alone = work / "figure.html"
    script_end = text.rindex("</body>")
    keep = (
        "<style>.only { display: block !important; position: fixed; inset: 0; margin: 0; padding: 12px; background: var(--paper); z-index: 9 }"
        ".only figcaption, .only .hint, .only .view-buttons, .only .magnifier { display: none }</style>"
    )
    marked = text[:script_end] + keep + text[script_end:]
    place = marked.index(f'data-view="{view}"')
    marked = marked[:place] + 'class="only" ' + marked[place:]
    alone.write_text(marked)
    return screenshot(alone, width, height)


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
        report = work / "run/report.html"
        save("report.jpg", scaled(screenshot(report, 1280, 1000), 960), 75)
        save("residuals.jpg", scaled(figure_of(report, "residual-field", work), 620))
        overlay = work / "detections"
        heba(program, "detect", work / "sample/config.yaml", "--out", overlay)
        seen = first_image(overlay / "overlays")
        save("overlay.jpg", scaled(seen, 640))
        cell = figure_of(report, "set-up", work, 640, 480)
        save("cell.jpg", np.hstack([cell, cv2.resize(seen, (640, 480), interpolation=cv2.INTER_AREA)]))
        (work / "cell.yaml").write_text(PLANNED)
        heba(program, "plan", work / "cell.yaml", "--count", "12", "--out", work / "plan.csv")
        save("plan.jpg", scaled(screenshot(work / "plan.html", 1280, 1000), 960), 75)


if __name__ == "__main__":
    main(sys.argv[1])
