"""One step of the online trajectory generator Ruckig, which raises where its documentation returns a result."""

from __future__ import annotations

from ruckig import InputParameter, OutputParameter, Result, Ruckig, RuckigError


def take_step(generator: Ruckig, given: InputParameter, output: OutputParameter, dt: float) -> bool:
    """Write to ``output`` where the joints are after ``dt`` [s]; tells whether a way was found.

    It cannot always be, at speeds of a few degrees a second.
    """
    generator.delta_time = dt
    try:
        return generator.update(given, output) in (Result.Working, Result.Finished)
    except (RuckigError, ValueError):  # the latter for results that its Python side does not know
        generator.reset()
        return False
