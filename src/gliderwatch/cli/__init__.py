"""The command line: one module a group of commands."""

import os

# Its matrices are small: threads of OpenBLAS, which numpy begins when it is loaded, would only wait for each
# other, and do so at twice the processor where the machine is busy.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
