from .c_code import CCode, c
from .co_simulation import fmu
from .compiled import CompiledController
from .ring import Controller
from .tables import Table, table

__all__ = ["CCode", "CompiledController", "Controller", "Table", "c", "fmu", "table"]
