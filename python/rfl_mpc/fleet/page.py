"""The fleet as one page: vehicles, the ones that changed first, and the history of each; reports lie beside it.

Plotly draws the histories, because people want to zoom to the drive at which a value steps; its library is embedded
(some 5 MB), so that the page opens anywhere. Small curves in the table are plain SVG.
"""

from __future__ import annotations

import html
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from rfl_mpc.fleet.changes import Change
from rfl_mpc.fleet.findings import Finding
from rfl_mpc.fleet.reduce import TypeState, VehicleState
from rfl_mpc.fleet.summary import MASSES

STYLE = """
:root { color-scheme: light dark; --line: color-mix(in srgb, currentColor 18%, transparent); --hit: #d9480f; }
body { font: 15px/1.45 system-ui, sans-serif; max-width: 75rem; margin: 0 auto; padding: 1rem; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2rem; }
table { border-collapse: collapse; width: 100%; }
th, td { text-align: left; padding: .3rem .6rem; border-bottom: 1px solid var(--line); }
th { position: sticky; top: 0; background: Canvas; }
td.number, th.number { text-align: right; font-variant-numeric: tabular-nums; }
.wide { overflow-x: auto; } svg { display: block; } .hit { color: var(--hit); font-weight: 600; } .dim { opacity: .65; }
section { border-top: 1px solid var(--line); padding-top: .5rem; } .plot { height: 300px; }
input { font: inherit; padding: .2rem .4rem; }
@media (max-width: 45rem) { #fleet :is(th, td):is(:nth-child(2), :nth-child(3), :nth-child(5)) { display: none; } }
@media print { .plot { break-inside: avoid; } input { display: none; } }
"""
HISTORIES = 60
"""Vehicles whose history is drawn: the changed ones, then the likeliest."""
NAMED = 5
"""Drives that are named of those with a finding; column findings of verdicts.parquet has all."""
ROWS = 2000
"""Vehicles in the table; all are in vehicles.parquet."""


@dataclass(frozen=True)
class History:
    """Values of an effect by drive, as each drive alone says it."""

    effect: str
    unit: str
    value: np.ndarray
    deviation: np.ndarray
    labels: Sequence[str]


def said_changes(state: VehicleState) -> list[Change]:
    return [change for change, said in zip(state.changes, state.said) if said]


def order(types: Sequence[TypeState]) -> list[VehicleState]:
    """Vehicles, the worst first: those with changes by probability, then the likeliest candidates."""

    def rank(state: VehicleState) -> tuple[Any, ...]:
        lasting = [change.probability for change in said_changes(state) if not change.passing]
        any_said = [change.probability for change in said_changes(state)]
        candidate = state.candidate.probability if state.candidate else 0.0
        return -max(lasting, default=0.0), -max(any_said, default=0.0), -candidate, state.vehicle

    return sorted((state for of in types for state in of.vehicles), key=rank)


def number(value: float) -> str:
    return f"{value:.4g}"


def words(change: Change, unit: str, labels: Sequence[str]) -> str:
    """A change in one line."""
    when = labels[change.since]
    if change.passing:
        place = f"on drive {change.since + 1} ({when}) alone"
    elif change.since == 0:
        place = "on all drives"
    else:
        place = f"since drive {change.since + 1} ({when})"
        if change.earliest != change.latest:
            place += f", or drive {change.earliest + 1} to {change.latest + 1}"
    unit = "" if unit == "1" else f" {unit}"
    return (
        f"{change.effect} {number(change.before)} → {number(change.value)}{unit} "
        f"({number(change.low)} to {number(change.high)}) {place}"
    )


def shared(of: TypeState, one: Change) -> str:
    """What all vehicles of a type share, in one line."""
    parameter = of.parameter(one.effect)
    unit = "" if parameter.unit == "1" else f" {parameter.unit}"
    text = f"{one.effect} {number(one.value)}{unit} ({number(one.low)} to {number(one.high)})"
    if one.effect in MASSES:
        text += f": the vehicle file's {number(parameter.given)}{unit} are too many"
    return f"{text}, probability {one.probability:.2f}"


def spark(history: History | None, change: Change | None) -> str:
    """A small curve of a value by drive; the step of a change over it."""
    if history is None or len(history.value) < 2:
        return ""
    finite = np.where(np.isfinite(history.value), history.value, np.nan)
    if np.isnan(finite).all():
        return ""
    low, high = np.nanmin(finite), np.nanmax(finite)
    if not np.isfinite(low) or high <= low:
        return ""
    width, height = 150, 28
    x = np.linspace(2, width - 2, len(finite))
    y = height - 3 - (finite - low) / (high - low) * (height - 6)
    points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y) if np.isfinite(b))
    mark = ""
    if change is not None:
        mark = f'<line x1="{x[change.since]:.1f}" x2="{x[change.since]:.1f}" y1="0" y2="{height}" stroke="#d9480f"/>'
    return (
        f'<svg width="{width}" height="{height}" role="img" aria-label="{html.escape(history.effect)} by drive">{mark}'
        f'<polyline points="{points}" fill="none" stroke="currentColor"/></svg>'
    )


def page(
    types: Sequence[TypeState],
    labels: Callable[[str], Sequence[str]],
    history: Callable[[TypeState, VehicleState, str], History | None],
    reports: Mapping[str, Sequence[tuple[int, str]]],
    counts: Mapping[str, int],
    faults: tuple[Sequence[tuple[str, int, str]], Sequence[Finding]],
    version: str,
) -> str:
    """The page; ``reports`` are the single reports of a vehicle: drive and place. ``faults``: vehicle, drive and
    words of those that were not diagnosed, and findings in the others' logs."""
    from plotly.offline import get_plotlyjs

    errors, findings = faults
    of_type = {state.vehicle: of for of in types for state in of.vehicles}
    states = order(types)
    changed = [state for state in states if any(not change.passing for change in said_changes(state))]
    passing = sum(1 for state in states if said_changes(state) and state not in changed)
    drawn: list[str] = []
    rows, sections = [], []
    for place, state in enumerate(states[:ROWS]):
        of, names = of_type[state.vehicle], labels(state.vehicle)
        said = said_changes(state)
        first = said[0] if said else state.candidate
        effect = first.effect if first else None
        curve = history(of, state, effect) if effect and place < HISTORIES else None
        text = "<br>".join(html.escape(words(one, of.unit(one.effect), names)) for one in said)
        if not said:
            text = "no change"
            if first and first.probability > 0.1:
                text += f" <span class=dim>(perhaps {html.escape(first.effect)}, {first.probability:.2f})</span>"
        probability = f"{said[0].probability:.2f}" if said else f"{state.nothing:.2f}"
        name = html.escape(state.vehicle)
        link = f'<a href="#v{place}">{name}</a>' if curve is not None else name
        hit = " class=hit" if state in changed else ""
        rows.append(
            f"<tr><td>{link}</td><td>{html.escape(_short(state.type))}</td><td class=number>{state.drives}</td>"
            f"<td{hit}>{text}</td><td class=number>{probability}</td>"
            f"<td>{spark(curve, first if said else None)}</td></tr>"
        )
        if curve is None:
            continue
        drawn.append(_plot(f"p{place}", curve, [one for one in said if one.effect == curve.effect]))
        also = "; ".join(
            f"{html.escape(one.effect)} or " + ", ".join(f"{html.escape(k)} ({v:.2f})" for k, v in one.also.items())
            for one in said if one.also
        )  # fmt: skip
        links = ", ".join(
            f'<a href="{html.escape(href)}">report of drive {row + 1}</a>'
            for row, href in reports.get(state.vehicle, ())
        )
        sections.append(
            f'<section id="v{place}"><h3>{name}</h3><p>{text}</p>'
            + (f"<p>Not told apart: {also}.</p>" if also else "")
            + (f"<p>{links}</p>" if links else "")
            + f'<div class=plot id="p{place}"></div></section>'
        )
    more = f"<p class=dim>{len(states) - ROWS} more in vehicles.parquet.</p>" if len(states) > ROWS else ""
    head = (
        f"{counts['drives']} drives of {counts['vehicles']} vehicles of {len(types)} types. "
        f"<b>{len(changed)} changed</b>"
        + (f", {passing} were otherwise on single drives" if passing else "")
        + (f", {len(errors)} drives were not diagnosed" if errors else "")
        + "."
    )
    failed = ""
    if errors:
        failed = "<h2>Not diagnosed</h2><div class=wide><table><tr><th>vehicle<th class=number>drive<th>why</tr>"
    failed += "".join(
        f"<tr><td>{html.escape(vehicle)}</td><td class=number>{row + 1}</td><td>{html.escape(text)}</td></tr>"
        for vehicle, row, text in errors[:ROWS]
    )
    failed += "</table></div>" if errors else ""
    failed += _findings(findings)
    return f"""<!doctype html>
<html lang="en"><head><meta charset="utf-8"><meta name="viewport" content="width=device-width">
<title>Fleet: {len(changed)} of {counts["vehicles"]} vehicles changed</title><style>{STYLE}</style>
<script>{get_plotlyjs()}</script></head><body>
<h1>Fleet</h1><p>{head}</p>
<h2>Vehicles</h2>
<p><input type="search" placeholder="find a vehicle or an effect" aria-label="find"
 oninput="for (const row of document.querySelectorAll('#fleet tbody tr'))
  row.hidden = !row.textContent.toLowerCase().includes(this.value.toLowerCase())"></p>
<div class=wide><table id=fleet><thead><tr><th>vehicle<th>type<th class=number>drives<th>what changed
<th class=number>probability<th>by drive</tr></thead><tbody>{"".join(rows)}</tbody></table></div>{more}
<h2>Types</h2>
<p>What all vehicles of a type share is an error of their vehicle file, or something that all of them have; it is no
change. What the simulator simplifies is wrong in the same way on every drive, so that many drives tell hardly more of a
type than one does. The intervals (95 %) of all values allow for that; the step of a change is known better.</p>
{"".join(_type(of) for of in types)}
<h2>Histories</h2>
<p>Each point is what one drive alone says, with a 95 % interval for comparing drives; the line is what all drives of
the vehicle say.</p>
{"".join(sections)}
{failed}
<p class=dim>rfl fleet {html.escape(version)}; verdicts.parquet has a row a drive, vehicles.parquet a row a change.</p>
<script>{"".join(drawn)}</script></body></html>
"""


def _findings(findings: Sequence[Finding]) -> str:
    """What was found in logs that were diagnosed, a row a kind."""
    if not findings:
        return ""
    rows = []
    for one in findings:
        named = ", ".join(f"drive {place + 1} of {html.escape(vehicle)}" for vehicle, place in one.drives[:NAMED])
        more = f" and {len(one.drives) - NAMED} more" if len(one.drives) > NAMED else ""
        count = len(one.drives)
        rows.append(f"<tr><td>{html.escape(one.text)}</td><td class=number>{count}</td><td>{named}{more}</td></tr>")
    head = "<tr><th>such as<th class=number>drives<th>which</tr>"
    return f"<h2>Found in logs</h2><div class=wide><table>{head}{''.join(rows)}</table></div>"


def _short(type: str) -> str:
    return type.rsplit("/", 2)[-2] + "/" + type.rsplit("/", 1)[-1] if "/" in type else type


def _type(of: TypeState) -> str:
    """A type: what all its vehicles share, and how far they and their drives differ."""
    common = "; ".join(f"<span class=hit>{html.escape(shared(of, one))}</span>" for one in of.common)
    deviation = np.sqrt(np.maximum(np.diag(of.spread.true_covariance), 0.0))
    off = ", ".join(
        f"{html.escape(of.parameters[i].name)} {number(of.parameters[i].value(of.spread.true_mean[i]))} ± "
        f"{number(1.96 * deviation[i] * of.parameters[i].scale)} (simulator {number(of.parameters[i].given)})"
        for i in of.differs
    )
    rows = []
    for i, it in enumerate(of.parameters):
        if it.tolerance <= 0.0:
            continue
        scale = it.tolerance
        rows.append(
            f"<tr><td>{html.escape(it.name)}</td><td class=number>{number(it.given)}</td>"
            f"<td class=number>{number(it.value(of.spread.true_mean[i]))} ± {number(1.96 * deviation[i] * scale)}</td>"
            f"<td class=number>{number(scale * of.spread.between_vehicles[i] ** 0.5)}</td>"
            f"<td class=number>{number(scale * of.spread.between_drives[i] ** 0.5)}</td>"
            f"<td class=number>{number(scale)}</td><td>{html.escape(it.unit)}</td></tr>"
        )
    return (
        f"<section><h3>{html.escape(_short(of.type))}</h3><p>{len(of.vehicles)} vehicles, {of.drives} drives. "
        f"All of them share: {common or 'nothing beyond ordinary tolerances'}.</p>"
        + (f"<p>Surely not as the simulator has it: {off}.</p>" if off else "")
        + "<details><summary>Parameters</summary><div class=wide><table>"
        "<tr><th>parameter<th class=number>simulator"
        "<th class=number>fleet, ± 95 %<th class=number>between vehicles<th class=number>between drives"
        "<th class=number>tolerance<th>unit</tr>" + "".join(rows) + "</table></div></details></section>"
    )


def _plot(place: str, history: History, changes: Sequence[Change]) -> str:
    """Plotly's call for a history."""
    x = list(range(1, len(history.value) + 1))
    finite = [None if not np.isfinite(one) else float(f"{one:.6g}") for one in history.value]
    points = {
        "x": x, "y": finite, "mode": "markers", "name": "one drive", "text": list(history.labels),
        "error_y": {"type": "data", "array": [float(f"{1.96 * one:.4g}") for one in history.deviation], "thickness": 1},
    }  # fmt: skip
    lines = []
    for change in changes:
        end = change.since + 1 if change.passing else len(x)
        lines.append({
            "x": [1, change.since + 0.5, change.since + 0.5, end + 0.5],
            "y": [change.before, change.before, change.value, change.value],
            "mode": "lines", "line": {"color": "#d9480f"}, "name": "all drives",
        })  # fmt: skip
    unit = "" if history.unit == "1" else f" in {history.unit}"
    layout = {
        "margin": {"l": 70, "r": 10, "t": 10, "b": 40}, "xaxis": {"title": {"text": "drive"}}, "showlegend": False,
        "yaxis": {"title": {"text": history.effect + unit}},
        "paper_bgcolor": "rgba(0,0,0,0)", "plot_bgcolor": "rgba(0,0,0,0)",
        "font": {"color": "#888"},
    }  # fmt: skip
    words = ",".join(map(json.dumps, (place, [points, *lines], layout, {"responsive": True})))
    return f"Plotly.newPlot({words});\n"
