"""What the functions give: the numbers of `rfl`'s JSON, the text that it prints, a view for notebooks."""

from __future__ import annotations

import html
import json
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from rfl_mpc._call import File, file_name, reason
from rfl_mpc._native import RflError

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd


def _table(rows: Iterable[tuple[str, ...]], head: tuple[str, ...] = ()) -> str:
    def line(cells: tuple[str, ...], tag: str) -> str:
        return "<tr>" + "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells) + "</tr>"

    return f"<table>{line(head, 'th') if head else ''}{''.join(line(row, 'td') for row in rows)}</table>"


def _framed(page: str) -> str:
    """A whole page inside a notebook's cell."""
    return f'<iframe srcdoc="{html.escape(page)}" style="width:100%;height:640px;border:0"></iframe>'


@dataclass(frozen=True, repr=False)
class _Result:
    """Numbers and words of a command."""

    report: dict[str, Any]
    """What ``rfl`` writes with ``--json``."""
    text: str
    """What ``rfl`` prints."""

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True, repr=False)
class Drive(_Result):
    """A drive of the closed loop."""

    columns: dict[str, np.ndarray] = field(default_factory=dict)
    """Columns of the log by name, of shape ``(rows,)``, SI units and radians."""
    statuses: tuple[str, ...] = ()
    """The controller's status at each row, in a word."""

    @classmethod
    def of(cls, report: str, text: str, columns: list[tuple[str, bytes]], statuses: list[str]) -> Drive:
        import numpy as np

        return cls(json.loads(report), text, {name: np.frombuffer(data) for name, data in columns}, tuple(statuses))

    @property
    def log(self) -> pd.DataFrame:
        """The drive log: a row for each communication step, the columns of :attr:`columns` and ``status``."""
        import pandas as pd

        return pd.DataFrame({**self.columns, "status": pd.Categorical(list(self.statuses))})

    @property
    def outcome(self) -> str:
        """``completed``, ``stopped``, ``lost`` or ``timed_out``."""
        return self.report["outcome"]

    @property
    def reason(self) -> str:
        """The outcome in words."""
        return self.report["reason"]

    @property
    def tracking(self) -> dict[str, float]:
        """Lateral error of the whole drive, m: ``mae``, ``rmse``, ``max``, and ``count`` of rows."""
        return self.report["tracking"]

    @property
    def actuator(self) -> dict[str, float | bool] | None:
        """Steering as the drive has shown it: ``dead_time``, ``time_constant``, ``spread`` of their sum, s; whether the
        drive has ``shown`` them; ``backlash``, rad."""
        return self.report["actuator"]

    @property
    def requirements(self) -> list[dict[str, Any]]:
        """What was required: ``requirement``, whether it is ``met``, and the ``summary``."""
        return self.report["requirements"]

    def __repr__(self) -> str:
        tracking = self.tracking
        return f"Drive({self.outcome}: {self.reason}; rmse {tracking['rmse']:.4f} m, max {tracking['max']:.4f} m)"

    def _repr_html_(self) -> str:
        rows = [("whole drive", self.tracking), *self.report["classes"].items()]
        cells = [(name, *(f"{of[key]:.4f}" for key in ("mae", "rmse", "max"))) for name, of in rows]
        head = ("lateral error", "mean m", "RMS m", "max m")
        return f"<p><b>{html.escape(self.outcome)}</b>: {html.escape(self.reason)}</p>{_table(cells, head)}"


@dataclass(frozen=True, repr=False)
class Report(_Result):
    """Why a log and a simulator disagree; the fields are those of ``report.json``."""

    page: str = ""

    @classmethod
    def of(cls, report: str, text: str, page: str) -> Report:
        return cls(json.loads(report), text, page)

    @property
    def verdict(self) -> dict[str, Any]:
        """``kind`` (``none``, ``effect``, ``not_in_library``, ``cannot_tell``), its ``probability``, ``summary``."""
        return self.report["verdict"]

    @property
    def candidates(self) -> list[dict[str, Any]]:
        """All candidates, the best first."""
        return self.report["candidates"]

    @property
    def posterior(self) -> dict[str, Any] | None:
        """How probable each hypothesis is."""
        return self.report["posterior"]

    @property
    def gap_reduction(self) -> dict[str, Any]:
        """Reduction of the gap, by signal."""
        return self.report["gap_reduction"]

    @property
    def shrink(self) -> dict[str, Any]:
        """:attr:`gap_reduction` under its former name, for one version."""
        return self.gap_reduction

    @property
    def findings(self) -> list[dict[str, Any]]:
        """What was found wrong, missing or mended in the log, the gravest first."""
        return self.report["findings"]

    @property
    def next_manoeuvre(self) -> dict[str, Any] | None:
        """What to drive next."""
        return self.report["next_manoeuvre"]

    def to_html(self) -> str:
        """The report as one page that needs nothing else."""
        return self.page

    def to_json(self) -> str:
        """The report as ``rfl diagnose`` writes it to ``report.json``."""
        return json.dumps(self.report, indent=2, ensure_ascii=False) + "\n"

    def save(self, file: File) -> None:
        """Writes the page (``.html``) or the numbers (``.json``); a folder that is missing is made."""
        file = Path(file_name(file))
        suffix = file.suffix.lower()
        if suffix not in (".html", ".htm", ".json"):
            raise RflError(f"{file}: a report is written as .html or .json; give a file with one of these endings")
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(self.to_json() if suffix == ".json" else self.page, encoding="utf-8")
        except OSError as error:
            raise RflError(f"{file}: cannot be written ({reason(error)}); give another file") from None

    def __repr__(self) -> str:
        return (
            f"Report({self.verdict['kind']}, probability {self.verdict['probability']:.2f}: {self.verdict['summary']})"
        )

    def _repr_html_(self) -> str:
        return _framed(self.page)


class Estimate(NamedTuple):
    """A number with its 90 % interval."""

    value: float
    low: float
    high: float
    excited: bool
    """Whether the logs determine it."""


@dataclass(frozen=True, repr=False)
class Steering(_Result):
    """The steering actuator as logs show it."""

    @classmethod
    def of(cls, report: str, text: str) -> Steering:
        return cls(json.loads(report), text)

    def _number(self, name: str) -> Estimate | None:
        found = self.report.get(name)
        return None if found is None else Estimate(found["value"], found["low"], found["high"], found["excited"])

    @property
    def dead_time(self) -> Estimate | None:
        """Dead time, s; ``None`` of a short record of a step, whose models are in ``report["models"]``."""
        return self._number("dead_time")

    @property
    def lag(self) -> Estimate | None:
        """Time constant of the first-order lag, s."""
        return self._number("lag")

    @property
    def delay(self) -> Estimate | None:
        """Dead time and lag together, s."""
        return self._number("delay")

    @property
    def gain(self) -> Estimate | None:
        """Angle for each rad of the command."""
        return self._number("gain")

    @property
    def offset(self) -> Estimate | None:
        """Angle at a command of 0, rad."""
        return self._number("offset")

    @property
    def backlash(self) -> Estimate | None:
        """Full width of the gap behind the lag, rad of the command; ``None`` if the logs show none."""
        return self._number("backlash")

    def _rows(self) -> list[tuple[str, ...]]:
        units = {"dead_time": "s", "lag": "s", "delay": "s", "gain": "", "offset": "rad", "backlash": "rad"}
        found = [(name, unit, one) for name, unit in units.items() if (one := self._number(name)) is not None]
        return [
            (name, f"{one.value:.4f}", f"{one.low:.4f} ... {one.high:.4f}", unit, "" if one.excited else "not excited")
            for name, unit, one in found
        ]

    def __repr__(self) -> str:
        return f"Steering({'; '.join(' '.join(row).strip() for row in self._rows())})"

    def _repr_html_(self) -> str:
        return _table(self._rows(), ("", "value", "90 % interval", "unit", ""))


@dataclass(frozen=True, repr=False)
class Training(_Result):
    """What was learned from logs."""

    @classmethod
    def of(cls, report: str, text: str) -> Training:
        return cls(json.loads(report), text)

    @property
    def file(self) -> Path | None:
        """The model's file; ``None`` where none was written."""
        file = self.model.get("file")
        return None if file is None else Path(file)

    @property
    def model(self) -> dict[str, Any]:
        """Kind, fit (``train``, ``held_out``, ``test``) and proof of the model."""
        return self.report["models"][0]

    @property
    def proven(self) -> bool:
        """Whether driving with it is better in simulated closed loop; ``False`` without a proof."""
        return bool(self.model.get("proven"))

    def __repr__(self) -> str:
        return f"Training({self.model['kind']}, {'proven' if self.proven else 'not proven'}, file {self.file})"

    def _repr_html_(self) -> str:
        return f"<p>{html.escape(repr(self))}</p><pre>{html.escape(self.text)}</pre>"


@dataclass(frozen=True, repr=False)
class Tuning(_Result):
    """What a search of weights and horizon found."""

    folder: Path = Path()

    @classmethod
    def of(cls, report: str, text: str, folder: Path) -> Tuning:
        return cls(json.loads(report), text, folder)

    @property
    def file(self) -> Path | None:
        """The controller file; ``None`` where nothing better than the default was found."""
        return self.folder / "controller.toml" if self.report["written"] else None

    @property
    def page(self) -> Path:
        """The page with margins and answers."""
        return self.folder / "tune.html"

    def __repr__(self) -> str:
        return f"Tuning({'better than the default' if self.file else 'the default is no worse'}, page {self.page})"

    def _repr_html_(self) -> str:
        return _framed(self.page.read_text(encoding="utf-8"))
