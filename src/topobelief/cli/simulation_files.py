"""What `topobelief simulate` leaves behind: data after each leg, pictures and a recording at the end."""

from __future__ import annotations

from pathlib import Path

from topobelief.cli.plan_files import write_together
from topobelief.simulation.record import Record
from topobelief.simulation.results import writers

_STALE = ("leg-*.json", "leg-*.png", "run.png", "trips.png", "run.mcap")


class RunFiles:
    """The folder of one run.

    Parameters
    ----------
    folder
        Made when first written to.
    keep
        Whether the files of an earlier run are part of this one; they are removed otherwise.
    """

    def __init__(self, folder: Path, *, keep: bool) -> None:
        self._folder, self._keep = folder, keep
        self.names: list[str] = []

    def write(self, record: Record) -> None:
        """All data of a run as far as it went, whole or not at all."""
        files = writers(record)
        write_together(self._folder, files)
        record.occupancy.write(self._folder / "map.yaml")
        if not self._keep:
            for pattern in _STALE:
                for path in self._folder.glob(pattern):
                    if path.name not in files:
                        path.unlink()
        self.names = [*files, "map.yaml"]

    def draw(self, record: Record, *, pictures: bool, recording: bool) -> None:
        """The run, each of its decisions, and the recording."""
        if pictures:
            from topobelief.report.canvas import save_figure
            from topobelief.report.exploration_figure import draw_trips
            from topobelief.report.simulation_figures import draw_run, draw_topologies

            figures = {"run.png": draw_run(record)}
            if record.exploration is not None:
                figures["trips.png"] = draw_trips(record)
            for each in record.deliberations:
                leg = record.legs[each.leg]
                name = f"{record.scenario.name}, leg {each.leg + 1}, {'' if leg.trip else 'to '}{leg.name}"
                figures[f"leg-{each.leg + 1}.png"] = draw_topologies(each, record.scenario.world, name=name)
            write_together(
                self._folder,
                {name: lambda path, figure=figure: save_figure(figure, path) for name, figure in figures.items()},
            )
            self.names += figures
        if recording:
            from topobelief.report.recording import write_recording

            write_together(self._folder, {"run.mcap": lambda path: write_recording(record, path)})
            self.names.append("run.mcap")
