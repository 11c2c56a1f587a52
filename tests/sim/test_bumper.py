from common.freshness import NS_PER_S
from sim.bumper import Switch

MS = NS_PER_S // 1000


def test_one_that_does_not_bounce_is_what_touches_it() -> None:
    switch = Switch(0.0, 1)
    for now_ms, touched in ((0, False), (10, True), (10, True), (20, True), (30, False)):
        switch.touch(touched, now_ms * MS)
        assert switch.closed is touched


def test_after_each_change_it_opens_and_closes_for_its_time() -> None:
    switch = Switch(0.1, 1)
    for begin_ms, touched in ((0, True), (1000, False)):
        switch.touch(touched, begin_ms * MS)
        assert switch.closed is touched
        seen = []
        for after_ms in range(1, 100):
            switch.touch(touched, (begin_ms + after_ms) * MS)
            seen.append(switch.closed)
        assert 30 < sum(seen) < 70
        for after_ms in (100, 500):
            switch.touch(touched, (begin_ms + after_ms) * MS)
            assert switch.closed is touched
