"""Generated C put to compilers: every warning an error, and sanitizers that stop at the first fault."""

import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest

from piezoest.export.compiled import compiler

STRICT = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror")
DRIVER = """#include "{name}.h"
#include <stdio.h>

int main(void)
{{
    static {name}_state state;
    double pair[2];

    {name}_init(&state);
    while (fread(pair, sizeof(double), 2, stdin) == 2) {{
        volatile double u = (double)({call});
        if (!(u >= {low} && u <= {high})) {{
            return 3;
        }}
        {then}
    }}
    return {end};
}}
"""


def compile_strictly(cc: str, code: Any, folder: Path, level: str) -> None:
    if shutil.which(cc) is None:
        pytest.skip(f"{cc} is not installed: make tools")
    code.write(folder)
    command = [cc, *STRICT, level, "-c", f"{code.name}.c", "-o", f"{code.name}.o"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def under_sanitizers(code: Any, pairs: Any, folder: Path, **driver: str) -> tuple[int, bytes]:
    """What a driver that feeds pairs to the controller returns and says."""
    code.write(folder)
    given = {"name": code.name, "then": "", "end": "0", **driver}
    (folder / "driver.c").write_text(DRIVER.format(**given))
    flags = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g", "-O1"]
    command = [compiler(), "-std=c99", *flags, "driver.c", f"{code.name}.c", "-o", "driver", "-lm"]
    built = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if built.returncode != 0:
        pytest.skip(f"the compiler has no sanitizers: {built.stderr.strip().splitlines()[-1]}")
    done = subprocess.run([str(folder / "driver")], input=pairs.tobytes(), capture_output=True, check=False)
    return done.returncode, done.stderr
