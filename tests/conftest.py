"""For all tests: compiling says nothing, whose lines some tests would count, windows are drawn unseen, and
nobody computes in threads: there is a process on each processor, and threads that wait for others spin."""

import os
import signal

from hoof_env.simd.compile import QUIET

os.environ.setdefault(QUIET, "1")
os.environ["SDL_VIDEODRIVER"] = "dummy"
for library in ("OMP", "OPENBLAS", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

# A shell's background ignores interrupts, and so does what is started there; tests interrupt what they start.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
