"""Simulated stages: voltage in, measured and true displacement out."""

from piezoest.stage.instruments import Amplifier, Gauge
from piezoest.stage.paper import PaperStage
from piezoest.stage.preisach_stage import PreisachStage
from piezoest.stage.stage import SimulatedStage
from piezoest.stage.temperature import TemperatureLaw

__all__ = ["Amplifier", "Gauge", "PaperStage", "PreisachStage", "SimulatedStage", "TemperatureLaw"]
