"""How the project's figures look and are written: the same rows give the same bytes.

Colours are those of Okabe and Ito, which colour-blind readers can tell apart.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lalliance_study.extras import study_package

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BLACK, ORANGE, SKY, GREEN = "#000000", "#E69F00", "#56B4E9", "#009E73"
BLUE, VERMILION, PINK, GREY = "#0072B2", "#D55E00", "#CC79A7", "#777777"
FORMS = ("png", "svg")
STYLE: Any = {  # its keys are literals that mypy knows only if matplotlib is there
    "font.size": 9.5,
    "axes.titlesize": 10.5,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#E4E4E4",
    "grid.linewidth": 0.7,
    "axes.axisbelow": True,
    "legend.frameon": False,
    "figure.constrained_layout.use": True,
    "svg.hashsalt": "lalliance",
    "svg.fonttype": "none",
}


@contextmanager
def style() -> Iterator[None]:
    """Make figures look as they do here.

    Raises:
        MissingExtraError: matplotlib is not installed.
    """
    with study_package("matplotlib").rc_context(STYLE):
        yield


def write(figures: Mapping[str, "Figure"], out: Path, forms: Sequence[str] = FORMS) -> list[Path]:
    """Write figures into a folder, in each of `forms`; the files written."""
    out.mkdir(parents=True, exist_ok=True)
    paths = [out / f"{name}.{form}" for name in figures for form in forms]
    for path in paths:
        metadata = {"Date": None} if path.suffix == ".svg" else {"Software": None}
        figures[path.stem].savefig(path, dpi=160, metadata=metadata)
    return paths
