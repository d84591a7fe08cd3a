"""The demo's page: plots of each drive, in one file that opens anywhere, without a network.

Plotly draws them, because people want to zoom into an error and to see where on the road it lies. Its library is
embedded, hence the page's size (some 5 MB). Colours follow the reader's light or dark mode; paper is light.
"""

from __future__ import annotations

import html
import json
from itertools import pairwise

import demo_learning
import numpy as np
from plotly.offline import get_plotlyjs

POINTS = 1800  # per curve: more than a screen has, few enough to draw at once


def thin(drive, count: int = POINTS) -> np.ndarray:
    """Rows to draw: of each stretch of time the one with the largest lateral error, so that no peak is lost."""
    e1 = np.abs(drive.columns["e1"])
    edges = np.unique(np.linspace(0, len(e1), min(count, len(e1)) + 1).astype(int))
    return np.array([a + int(np.argmax(e1[a:b])) for a, b in pairwise(edges)])


def worst_between(values: np.ndarray, rows: np.ndarray) -> np.ndarray:
    """Largest value from each drawn row to the next."""
    return np.maximum.reduceat(values, rows)


def compact(values: np.ndarray, digits: int) -> list[float]:
    """Numbers for the page, without digits that no screen shows."""
    return [float(v) for v in np.round(values, digits)]


def data_of(route) -> dict:
    """What the page's script draws for one route."""
    rows, columns = thin(route.drive), route.drive.columns
    degrees = np.degrees
    # The road's nearest point, from the error and the road's heading: no need to read the road's file again.
    # A lap ends where it began: the distance driven goes on over the seam.
    station = columns["station"]
    laps = np.cumsum(np.diff(station, prepend=station[0]) < -0.5 * np.ptp(station))
    e1, heading = columns["e1"][rows], (columns["yaw"] - columns["e2"])[rows]
    return {
        "name": route.name,
        "road": {
            "x": compact(columns["x"][rows] + e1 * np.sin(heading), 2),
            "y": compact(columns["y"][rows] - e1 * np.cos(heading), 2),
        },
        "x": compact(columns["x"][rows], 3),
        "y": compact(columns["y"][rows], 3),
        "station": compact((station + laps * np.ptp(station))[rows], 1),
        "time": compact(columns["time"][rows], 2),
        "e1": compact(100 * e1, 2),
        "steer_cmd": compact(degrees(columns["steer_cmd"][rows]), 3),
        "steer": compact(degrees(columns["steer"][rows]), 3),
        "vx": compact(3.6 * columns["vx"][rows], 2),
        "speed_ref": compact(3.6 * columns["speed_ref"][rows], 2),
        "compute_time": compact(1e3 * worst_between(columns["compute_time"], rows), 4),
    }


def end_of(route) -> str:
    """How a drive ended, in red, where it was not driven to the road's end."""
    if route.drive.finished:
        return ""
    return f"<p class='bad'>{html.escape(route.outcome)}: {html.escape(route.drive.ending.reason)}</p>"


NAMES = ("default", "identified", "learned")


def compared_section(rows, figures: dict) -> str:
    """The table of the car with a slow steering, and a place for a plot of each road."""
    if not rows:
        return ""
    body = ""
    for row in rows:
        cells = ""
        for name in NAMES:
            of = figures[row.name].get(name)
            kind = "" if of is None or of["outcome"] == "completed" else " class='bad'"
            cells += f"<td{kind}>{html.escape(demo_learning.cell(of))}</td>"
        body += f"<tr><th>{html.escape(row.name)}</th>{cells}</tr>"
    plots = "".join(f"<h3>{html.escape(row.name)}</h3><div class='slow' id='slow{i}'></div>"
                    for i, row in enumerate(rows))  # fmt: skip
    return (
        f"<section><h2>A slow steering</h2><p>The same car with {html.escape(demo_learning.WORDS)}, of which the "
        "controller is told nothing. Default: it finds the steering while driving. Identified: "
        "<code>rfl identify</code> has found it before. Learned: with the residual model of <code>rfl learn</code>, "
        "from drives on other roads.</p>"
        "<div class='scroll'><table><thead><tr><th>lateral error, mean / max [mm]</th>"
        + "".join(f"<th>{name}</th>" for name in NAMES)
        + f"</tr></thead><tbody>{body}</tbody></table></div>{plots}</section>"
    )


def compared_data(row) -> dict:
    """What the page's script draws of a road: the error of each column along the way."""
    curves = {}
    for name, driven in row.drives.items():
        rows, columns = thin(driven), driven.columns
        curves[name] = {"time": compact(columns["time"][rows], 2), "e1": compact(1e3 * columns["e1"][rows], 2)}
    return {"name": row.name, "curves": curves}


def render(routes, result: dict, compared=()) -> str:
    """The page as text; `compared` are the drives of the car with a slow steering."""
    cells = []
    for route in routes:
        error = result["routes"][route.name]
        v = route.drive.columns["vx"]
        cells.append(
            f"<tr><th>{html.escape(route.name)}</th><td>{np.ptp(route.drive.columns['station']):,.0f}</td>"
            f"<td>{route.time:,.1f}</td><td>{3.6 * v.mean():.0f}</td><td>{3.6 * v.max():.0f}</td>"
            f"<td class='{'good' if route.drive.finished else 'bad'}'>{html.escape(route.outcome)}</td>"
            f"<td><b>{100 * error['mae']:.2f}</b></td><td>{100 * error['rmse']:.2f}</td>"
            f"<td>{100 * error['max']:.2f}</td></tr>"
        )
    step = result["step"]
    tiles = [
        ("mean step", f"{1e3 * step['mean_s']:.3f} ms"),
        ("p99 step", f"{1e3 * step['p99_s']:.3f} ms"),
        ("longest step", f"{1e3 * step['max_s']:.3f} ms"),
        ("missed deadlines", f"{step['missed']}"),
        ("real-time factor", f"{result['real_time_factor']:.0f} ×"),  # noqa: RUF001
    ]
    sections = "".join(
        f"<section><h2>{html.escape(route.name)}</h2>{end_of(route)}<div class='plots'>"
        f"<div class='map' id='map{i}'></div><div class='lines' id='lines{i}'></div></div></section>"
        for i, route in enumerate(routes)
    )
    return (
        PAGE.replace("{{rows}}", "".join(cells))
        .replace("{{tiles}}", "".join(f"<div><span>{k}</span><b>{v}</b></div>" for k, v in tiles))
        .replace("{{sections}}", sections)
        .replace("{{compared}}", compared_section(compared, result.get("slow_steering", {})))
        .replace("{{slow}}", json.dumps([compared_data(row) for row in compared]).replace("</", "<\\/"))
        .replace("{{data}}", json.dumps([data_of(route) for route in routes]).replace("</", "<\\/"))
        .replace("{{plotly}}", get_plotlyjs())
    )


PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>RFL-MPC: the closed loop of two FMUs</title>
<style>
:root { --paper: #ffffff; --ink: #1d2733; --faint: #5c6b7a; --line: #dfe4ea; --good: #1a7f4b; --bad: #c0362c; }
@media screen and (prefers-color-scheme: dark) {
  :root { --paper: #14181d; --ink: #e4e9ee; --faint: #94a1ae; --line: #2c343d; --good: #5fce93; --bad: #ff8a80; }
}
* { box-sizing: border-box }
body { margin: 0 auto; max-width: 1280px; padding: 28px 24px 48px; background: var(--paper); color: var(--ink);
  font: 15px/1.5 system-ui, -apple-system, "Segoe UI", "Helvetica Neue", Arial, sans-serif }
h1 { font-size: 26px; line-height: 1.2; margin: 0 0 4px } h2 { font-size: 19px; margin: 36px 0 6px }
p { color: var(--faint); margin: 0 0 20px; max-width: 76ch }
.scroll { overflow-x: auto }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums }
th, td { padding: 6px 12px; text-align: right; border-bottom: 1px solid var(--line); white-space: nowrap }
thead th { color: var(--faint); font-weight: 500; font-size: 13px } th:first-child { text-align: left; padding-left: 0 }
td:last-child, th:last-child { padding-right: 0 }
.good { color: var(--good) } .bad, p.bad { color: var(--bad); font-weight: 600 }
.tiles { display: flex; flex-wrap: wrap; gap: 12px 40px; margin: 22px 0 0 }
.tiles span { display: block; color: var(--faint); font-size: 13px } .tiles b { font-size: 20px; font-weight: 600 }
.plots { display: grid; grid-template-columns: minmax(0, 9fr) minmax(0, 11fr); gap: 12px }
.map, .lines { height: 620px } .slow { height: 260px } h3 { font-size: 15px; margin: 14px 0 0 }
@media (max-width: 820px) { .plots { grid-template-columns: minmax(0, 1fr) } .map { height: 420px } }
@media print {
  body { max-width: none; padding: 0; font-size: 13px } section { break-before: page } .modebar { display: none }
  .scroll { overflow: visible } th, td { padding: 5px 6px } thead th { font-size: 11px }
  .plots { grid-template-columns: minmax(0, 1fr) } .map { height: 320px } .lines { height: 530px }
}
</style>
</head>
<body>
<h1>The closed loop of two FMUs</h1>
<p>The controller <b>RflMpc</b> (adaptive model predictive control) drives the car <b>PassengerCar</b> along each road,
both as FMI 2.0 co-simulation units in fmpy. The lateral error is the distance of the car's centre of gravity from the
path, positive to its left. Move along a curve to see the place on the road; drag to zoom, double-click to return.</p>
<div class="scroll"><table>
<thead><tr><th>route</th><th>driven [m]</th><th>time [s]</th><th>mean [km/h]</th><th>top [km/h]</th><th>end</th>
<th>mean |e1| [cm]</th><th>RMSE [cm]</th><th>max [cm]</th></tr></thead>
<tbody>{{rows}}</tbody></table></div>
<div class="tiles">{{tiles}}</div>
{{compared}}
{{sections}}
<script>{{plotly}}</script>
<script>
const routes = {{data}};
const slow = {{slow}};
const darkMode = matchMedia("(prefers-color-scheme: dark)");
const themes = {
  light: { ink: "#1d2733", faint: "#5c6b7a", grid: "#e6eaef", road: "#cfd6de", main: "#1f6fd0", second: "#d98324",
    good: "#1a7f4b", scale: [[0, "#1f6fd0"], [0.5, "#d98324"], [1, "#c0362c"]], label: "#ffffff" },
  dark: { ink: "#e4e9ee", faint: "#94a1ae", grid: "#272f38", road: "#3a444f", main: "#6cb0ff", second: "#f0a95c",
    good: "#5fce93", scale: [[0, "#4f9cf5"], [0.5, "#f0a95c"], [1, "#ff6b5e"]], label: "#1e242b" },
};

function draw(index, theme) {
  const route = routes[index];
  const font = { family: "system-ui, -apple-system, Segoe UI, Helvetica Neue, Arial, sans-serif", size: 12,
    color: theme.faint };
  const axis = { gridcolor: theme.grid, zerolinecolor: theme.grid, linecolor: theme.grid, ticks: "" };
  const hoverlabel = { bgcolor: theme.label, bordercolor: theme.faint, font: { color: theme.ink } };
  const plain = { paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font, hoverlabel,
    modebar: { bgcolor: "rgba(0,0,0,0)", color: theme.faint, activecolor: theme.ink } };
  const options = { displaylogo: false, responsive: true,
    modeBarButtons: [["toImage", "zoom2d", "pan2d", "resetScale2d"]] };
  const size = route.e1.map(Math.abs);

  Plotly.react("map" + index, [
    { x: route.road.x, y: route.road.y, mode: "lines", line: { color: theme.road, width: 7 }, hoverinfo: "skip" },
    { x: route.x, y: route.y, mode: "markers", customdata: route.e1,
      marker: { size: 3.5, color: size, colorscale: theme.scale, cmin: 0, cmax: Math.max(...size),
        colorbar: { title: { text: "|e1| [cm]", side: "right" }, thickness: 10, len: 0.5, x: 1, outlinewidth: 0 } },
      hovertemplate: "x %{x:.1f} m, y %{y:.1f} m<br>e1 %{customdata:.1f} cm<extra></extra>" },
    { x: [route.x[0]], y: [route.y[0]], mode: "markers+text", text: ["start"], textposition: "top right",
      marker: { size: 9, color: theme.ink, symbol: "circle-open", line: { width: 2 } }, hoverinfo: "skip",
      textfont: { color: theme.ink } },
    { x: [null], y: [null], mode: "markers", hoverinfo: "skip",
      marker: { size: 15, color: "rgba(0,0,0,0)", line: { color: theme.ink, width: 2.5 } } },
  ], { ...plain, showlegend: false, margin: { l: 52, r: 10, t: 10, b: 44 }, dragmode: "pan",
    xaxis: { ...axis, title: { text: "x [m]" } },
    yaxis: { ...axis, title: { text: "y [m]" }, scaleanchor: "x" } }, options);

  const curve = (y, row, name, color, unit, more = {}) => ({ x: route.station, y, name, xaxis: "x", yaxis: "y" + row,
    mode: "lines", line: { color, width: 1.4, ...more }, hovertemplate: "%{y:.2f} " + unit });
  const rows = ["lateral error [cm]", "road-wheel angle [deg]", "speed [km/h]", "step time [ms], deadline 20"];
  const layout = { ...plain, showlegend: false, hovermode: "x unified", margin: { l: 52, r: 8, t: 22, b: 44 },
    xaxis: { ...axis, title: { text: "distance along the road [m]" }, anchor: "y4", hoverformat: ".0f",
      unifiedhovertitle: { text: "%{x:.0f} m" } }, annotations: [] };
  rows.forEach((title, row) => {
    const top = 1 - row * 0.258, bottom = top - 0.2;
    layout["yaxis" + (row ? row + 1 : "")] = { ...axis, domain: [bottom, top], rangemode: row > 1 ? "tozero" : "normal",
      nticks: 5, automargin: false };
    layout.annotations.push({ text: title, x: 0, xanchor: "left", xref: "paper", y: top + 0.004, yanchor: "bottom",
      yref: "paper", showarrow: false, font: { color: theme.ink, size: 13 } });
  });
  const key = (row, text) => layout.annotations.push({ text, x: 1, xanchor: "right", xref: "paper", showarrow: false,
    y: 1 - row * 0.258 + 0.004, yanchor: "bottom", yref: "paper" });
  key(1, `<span style="color:${theme.second}">commanded</span> · <span style="color:${theme.main}">measured</span>`);
  key(2, `<span style="color:${theme.second}">plan</span> · <span style="color:${theme.main}">driven</span>`);
  key(3, "longest in each stretch");
  Plotly.react("lines" + index, [
    curve(route.e1, "", "lateral error", theme.main, "cm"),
    curve(route.steer_cmd, "2", "commanded", theme.second, "deg"),
    curve(route.steer, "2", "measured", theme.main, "deg"),
    curve(route.speed_ref, "3", "plan", theme.second, "km/h", { dash: "dot" }),
    curve(route.vx, "3", "driven", theme.main, "km/h"),
    curve(route.compute_time, "4", "step", theme.main, "ms"),
  ], layout, options);
}

function drawSlow(index, theme) {
  const font = { family: "system-ui, -apple-system, Segoe UI, Helvetica Neue, Arial, sans-serif", size: 12,
    color: theme.faint };
  const axis = { gridcolor: theme.grid, zerolinecolor: theme.grid, linecolor: theme.grid, ticks: "" };
  const colours = { default: theme.second, identified: theme.good, learned: theme.main };
  const curves = Object.entries(slow[index].curves).map(([name, of]) => ({ x: of.time, y: of.e1, name, mode: "lines",
    line: { color: colours[name], width: 1.3 }, hovertemplate: "%{y:.1f} mm" }));
  Plotly.react("slow" + index, curves, { paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font,
    hovermode: "x unified", legend: { orientation: "h", y: 1.15 }, margin: { l: 52, r: 8, t: 26, b: 40 },
    hoverlabel: { bgcolor: theme.label, bordercolor: theme.faint, font: { color: theme.ink } },
    xaxis: { ...axis, title: { text: "time [s]" } }, yaxis: { ...axis, title: { text: "lateral error [mm]" } } },
    { displaylogo: false, responsive: true, modeBarButtons: [["toImage", "zoom2d", "pan2d", "resetScale2d"]] });
}

function drawAll(dark) {
  const theme = dark ? themes.dark : themes.light;
  routes.forEach((_, index) => draw(index, theme));
  slow.forEach((_, index) => drawSlow(index, theme));
}
drawAll(darkMode.matches);
routes.forEach((route, index) => {
  const lines = document.getElementById("lines" + index);
  const mark = (x, y) => Plotly.restyle("map" + index, { x: [[x]], y: [[y]] }, [3]);
  lines.on("plotly_hover", event => { const i = event.points[0].pointIndex; mark(route.x[i], route.y[i]); });
  lines.on("plotly_unhover", () => mark(null, null));
});
darkMode.addEventListener("change", event => drawAll(event.matches));
// On paper: light, and heights that leave a route on one page.
addEventListener("beforeprint", () => { drawAll(false); heights(320, 530); });
addEventListener("afterprint", () => { drawAll(darkMode.matches); heights(null, null); });
function heights(map, lines) {
  const set = (plot, height) => Plotly.relayout(plot, { height });
  routes.forEach((_, i) => { set("map" + i, map); set("lines" + i, lines); });
}
</script>
</body>
</html>
"""
