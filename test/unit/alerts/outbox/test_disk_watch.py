import errno

from rosbot_patrol.alerts.outbox.disk_watch import PATIENCE, DiskWatch

READ_ONLY = OSError(errno.EROFS, "Read-only file system")


def watch(tmp_path):
    return DiskWatch(tmp_path)


def test_a_disk_that_is_gone_is_told_once_and_once_when_it_is_back(tmp_path):
    disk, told = watch(tmp_path), []
    for now in range(100):
        if 20 <= now < 60:
            disk.failed(READ_ONLY, float(now), 1.79e9 + now)
        elif now == 60:
            disk.worked()
        notice = disk.notice(float(now), 1.79e9 + now)
        told += [(now, notice)] * (notice is not None)
    (gone_at, gone), (back_at, back) = told
    assert (gone_at, back_at) == (20 + int(PATIENCE), 60)
    assert gone.id != back.id
    assert "Read-only file system" in gone.text
    assert str(tmp_path) in gone.text
    assert "works again" in back.subject


def test_a_disk_that_is_full_for_a_moment_is_not_told(tmp_path):
    disk = watch(tmp_path)
    disk.failed(OSError(errno.ENOSPC, "No space left on device"), 0.0, 0.0)
    assert disk.notice(PATIENCE - 1.0, 0.0) is None
    disk.worked()
    assert disk.notice(PATIENCE + 1.0, 0.0) is None
    assert disk.error is None


def test_the_second_time_is_told_too(tmp_path):
    disk, ids = watch(tmp_path), set()
    for begin in (0.0, 100.0):
        disk.failed(READ_ONLY, begin, begin)
        ids.add(disk.notice(begin + PATIENCE, begin + PATIENCE).id)
        disk.worked()
        ids.add(disk.notice(begin + 50.0, begin + 50.0).id)
    assert len(ids) == 4
