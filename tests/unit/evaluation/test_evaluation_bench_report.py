"""The benchmark's JSON keeps its names; its tables and its picture can be made of what was measured."""

from __future__ import annotations

import json
from dataclasses import replace
from math import nan
from pathlib import Path

import numpy as np
import pytest
from bench_runs import LOOP, figures, run
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure
from rich.console import Console

from yumi_evaluation.bench.contenders import ECHO, PEERS, Mode
from yumi_evaluation.bench.figures import Figures
from yumi_evaluation.bench.report import (
    document,
    draw_histograms,
    histogram,
    latency_table,
    part_table,
    ratio_table,
    target_table,
)
from yumi_evaluation.bench.run import cpu_percent

SPREAD = {"median", "lowest", "highest", "rounds"}
COUNTERS = {"missed", "stale", "bad", "recovering", "unparsed", "duplicates"}
LATENCIES = {"p50_us", "p99_us", "p999_us", "max_us"}


def shown(*tables: object) -> str:
    console = Console(width=100)
    with console.capture() as capture:
        console.print(*tables)
    return capture.get()


def test_document_keeps_its_names() -> None:
    content = document(figures(), {}, {}, is_complete=True)
    assert set(content) == {"format", "complete", "machine", "settings", "summary", "targets", "runs"}
    assert content["format"] == "yumi-bench/1"
    summary = content["summary"]["control_loop_blocking/paced/1"]
    ratios = {f"{figure}_to_peer" for figure in LATENCIES}
    spreads = LATENCIES | ratios | {"cycles_per_second", "cpu_percent", "cpu_all_percent"}
    assert set(summary) == spreads | COUNTERS | {"cycles"}
    assert all(set(summary[name]) == SPREAD for name in spreads)
    assert set(content["targets"]["bad_replies"]) == {"bound", "holds"} | SPREAD


def test_parts_of_a_reply_are_those_of_the_echo_of_core_and_controller_and_what_is_left() -> None:
    stages = {"receive": 6.0, "decode": 2.0, "update": 8.0, "limit": 4.0, "encode": 1.0, "send": 5.0}
    measured = Figures((run(1, ECHO, 50.0), replace(run(1, LOOP, 80.0), stages=stages)))
    (line,) = [line for line in shown(part_table(measured)).splitlines() if "control_loop_blocking/paced/1" in line]
    assert line.split()[1:] == ["50", "7", "8", "15", "80"]
    assert "paced" not in shown(part_table(figures()))  # no stages are known


def test_document_keeps_the_names_of_a_run() -> None:
    (content,) = document(Figures((run(1, LOOP, 80.0),)), {}, {}, is_complete=False)["runs"]
    own = {"round", "contender", "mode", "cycles", "cycles_per_second", "cpu_percent", "cpu_all_percent"}
    assert set(content) == own | {"generator_late_max_us", "arms", "heard", "stages_us", "unanswered"}
    assert set(content["arms"][0]) == LATENCIES | COUNTERS


def test_document_is_json_when_a_server_never_answered() -> None:
    content = json.loads(json.dumps(document(Figures((run(1, LOOP, nan),)), {}, {}, is_complete=True), allow_nan=False))
    assert content["runs"][0]["arms"][0]["p50_us"] is None
    assert content["summary"]["control_loop_blocking/paced/1"]["p50_us"] is None


def test_tables_show_every_case_and_target() -> None:
    text = shown(latency_table(figures()), ratio_table(figures()), target_table(figures()))
    assert text.count("control_loop_blocking/paced/2") == 2
    assert "0.70 (0.60-0.80)" in text
    assert "ros_graph_busy_blocking/p99_us_to_calm" in text


@given(st.lists(st.floats(0.0, 1e9), min_size=1, max_size=300))
def test_histogram_has_a_place_for_every_latency(latencies: list[float]) -> None:
    edges, shares = histogram(latencies)
    assert len(edges) == len(shares) + 1
    assert sum(shares) == pytest.approx(1.0)


@given(st.floats(1.0, 99_000.0))
def test_histogram_counts_a_latency_between_its_edges(latency: float) -> None:
    edges, shares = histogram([latency])
    (index,) = np.flatnonzero(shares)
    assert edges[index] * (1 - 1e-9) <= latency <= edges[index + 1] * (1 + 1e-9)


def test_cpu_of_a_run_too_short_to_be_counted_is_left_out_of_tables_and_document() -> None:
    assert cpu_percent(0.002, 0.004) != cpu_percent(0.002, 0.004)  # nan
    assert cpu_percent(0.5, 2.0) == 25.0
    short = Figures((replace(run(1, LOOP, 80.0), cpu_percent=cpu_percent(0.01, 0.009), cpu_all_percent=nan),))
    assert document(short, {}, {}, is_complete=True)["runs"][0]["cpu_percent"] is None
    (line,) = [line for line in shown(ratio_table(short)).splitlines() if "control_loop" in line]
    assert line.split()[-1] == "–"


def test_picture_of_histograms_is_written(tmp_path: Path) -> None:
    latencies = np.array([[50_000, 0, 60_000]])
    measured = tuple(replace(run(1, each, 50.0), latencies=latencies) for each in (ECHO, LOOP))
    draw_histograms(Figures((*measured, run(1, LOOP, 80.0, mode=Mode.PING_PONG))), tmp_path / "picture.png")
    assert (tmp_path / "picture.png").stat().st_size > 10_000


def test_picture_names_each_contender_at_a_row_of_its_own_so_that_no_colour_stands_for_two(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pictures: list[Figure] = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, *_, **__: pictures.append(figure))
    contenders = [*PEERS, ECHO, LOOP]
    measured = [replace(run(1, each, 50.0), latencies=np.array([[50_000, 60_000]])) for each in contenders]
    draw_histograms(Figures(tuple(measured)), tmp_path / "picture.png")
    rows = pictures[0].axes
    assert len(rows) == len(contenders)
    assert {row.get_ylabel() for row in rows} == {each.title for each in contenders}
    assert all(len(row.patches) == 1 for row in rows)
    colours = {row.get_ylabel(): row.patches[0].get_facecolor() for row in rows}
    kinds = [{colours[each.title] for each in kind} for kind in (PEERS, [ECHO], [LOOP])]
    assert [len(kind) for kind in kinds] == [1, 1, 1]
    assert len(set.union(*kinds)) == 3
