"""From the notebook to the controller: C code, co-simulation units, tables."""

from piezoest.export.c_code import CCode, c
from piezoest.export.compiled import CompiledController
from piezoest.export.fmu import fmu
from piezoest.export.ring import Controller

__all__ = ["CCode", "CompiledController", "Controller", "c", "fmu"]
