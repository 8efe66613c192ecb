"""Air hockey games as tasks of BenchMARL.

The import registers the tasks, by names such as ``airhockey/duel``.
"""

from benchmarl.environments import _task_class_registry, task_config_registry
from hydra.core.config_store import ConfigStore

from benchmarl_airhockey.common import AirHockeyClass, AirHockeyTask

for _task in AirHockeyTask:
    _name = _task.name.lower()
    task_config_registry[f"airhockey/{_name}"] = _task
    _task_class_registry[f"airhockey_{_name}"] = _task.config_class
    ConfigStore.instance().store(
        name=f"airhockey_{_name}_config", group="task", node=_task.config_class
    )

__all__ = ["AirHockeyClass", "AirHockeyTask"]
