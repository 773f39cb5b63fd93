"""Plots by matplotlib, which is imported when one is drawn."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Sequence

from ._numpy import np

if TYPE_CHECKING:
    from ._result import Result
    from ._study import Study


def plot_poses(poses: np.ndarray, names: Sequence[str], axes: Any = None) -> Any:
    """Draws the axes of frames (x red, y green, z blue) at their positions, in their order."""
    axes = axes if axes is not None else _figure().add_subplot(projection="3d")
    positions = poses[:, :3, 3]
    length = 0.1 * float(np.linalg.norm(positions.max(axis=0) - positions.min(axis=0))) or 0.05
    axes.plot(*positions.T, color="0.7", linewidth=0.8)
    for column, color in enumerate(("tab:red", "tab:green", "tab:blue")):
        axes.quiver(*positions.T, *(length * poses[:, :3, column]).T, color=color, linewidth=1)
    for name, position in zip(names, positions):
        axes.text(*position, name, fontsize=6)
    axes.set_xlabel("x (m)")
    axes.set_ylabel("y (m)")
    axes.set_zlabel("z (m)")
    if hasattr(axes, "set_aspect"):
        axes.set_aspect("equal")
    return axes


def plot_images(result: Result, axes: Any = None) -> Any:
    """Draws how far each image is from the prediction of the others (mm), or its RMS (px) without hold-outs."""
    axes = axes if axes is not None else _figure().add_subplot()
    images = [image for image in _images_of(result) if image["used"]]
    is_held_out = any(image["holdout_target_mm"] is not None for image in images)
    key = "holdout_target_mm" if is_held_out else "rms_px"
    by_camera: dict[str, list[tuple[int, float]]] = {}
    for place, image in enumerate(images):
        if image[key] is not None:
            by_camera.setdefault(image["camera"], []).append((place, image[key]))
    for camera, values in by_camera.items():
        axes.bar(*zip(*values), label=camera or None)
    step = 1 + len(images) // 40  # More names than these cannot be read.
    shown = range(0, len(images), step)
    axes.set_xticks(shown, [images[place]["image"] for place in shown], rotation=90, fontsize=6)
    axes.set_ylabel("distance from the prediction of the others (mm)" if is_held_out else "RMS residual (px)")
    axes.set_title(f"{result.data['name']}: {result.verdict['grade']}")
    if len(by_camera) > 1:
        axes.legend()
    return axes


def plot_study(study: Study, x: str, y: str, axes: Any = None) -> Any:
    """Draws a column of a study's rows over another one, a line for each method and scene."""
    axes = axes if axes is not None else _figure().add_subplot()
    lines: dict[str, list[tuple[float, float]]] = {}
    for row in study.rows:
        if row[x] is not None and row[y] is not None:
            lines.setdefault(" ".join(str(name) for name in (row.get("scene"), row["method"]) if name is not None), []).append((row[x], row[y]))
    for name, points in lines.items():
        axes.plot(*zip(*sorted(points)), marker="o", markersize=3, label=name)
    axes.set_xlabel(x)
    axes.set_ylabel(y)
    if lines:
        axes.legend(fontsize=7)
    return axes


def _images_of(result: Result) -> list[dict[str, Any]]:
    """Returns the images of a result with their RMS, in one form for runs of one camera and of several."""
    images = []
    for entry in result.data.get("images") or result.data["captures"]:
        squares = [
            (target["points"], target["rms_px"] ** 2)
            for target in entry.get("targets", [])
            if target["used"] and target["rms_px"] is not None
        ]
        total = sum(points for points, _ in squares)
        rms_px = (sum(points * square for points, square in squares) / total) ** 0.5 if total else entry.get("rms_px")
        images.append({"camera": entry.get("camera", ""), **entry, "rms_px": rms_px})
    return images


def _figure() -> Any:
    try:
        from matplotlib import pyplot
    except ImportError as error:
        why = (str(error).strip().splitlines() or ["it cannot be imported"])[0]
        raise ImportError(f"plots need matplotlib: {why}; install matplotlib", name="matplotlib") from None
    return pyplot.figure(layout="constrained")
