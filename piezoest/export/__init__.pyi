from .c_code import c
from .co_simulation import fmu
from .compiled import CompiledController, CompiledFeedforward
from .generated import CCode
from .ring import Controller
from .tables import Table, table

__all__ = ["CCode", "CompiledController", "CompiledFeedforward", "Controller", "Table", "c", "fmu", "table"]
