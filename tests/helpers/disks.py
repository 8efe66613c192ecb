"""Disks that are full."""

import resource
from contextlib import contextmanager


@contextmanager
def largest_file(size):
    """Let the system refuse larger files, which is an error as of a full disk."""
    usual = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, usual[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, usual)
