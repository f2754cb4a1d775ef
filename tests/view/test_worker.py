"""The thread in which a tab works."""

import threading
import time

from hoof_env.view.worker import Worker


def test_it_is_busy_from_a_job_s_start_to_its_end_and_no_longer():
    worker = Worker()
    may_end = threading.Event()
    has_ended = threading.Event()
    assert worker.busy_for == 0.0
    assert not worker.is_busy
    began = time.monotonic()
    worker.do(may_end.wait)
    time.sleep(0.2)
    worker.do(has_ended.set)
    assert worker.is_busy
    # The clock of some systems has steps of 16 ms.
    assert 0.1 <= worker.busy_for <= time.monotonic() - began
    may_end.set()
    assert has_ended.wait(60)
    while worker.is_busy and time.monotonic() < began + 60:
        time.sleep(0.01)
    assert not worker.is_busy
    assert worker.busy_for == 0.0
    worker.end()
