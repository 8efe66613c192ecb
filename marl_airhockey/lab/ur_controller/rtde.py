"""Real-time data exchange: the protocol of port 30004, version 2.

A package is a big-endian size (2 bytes, of all of it), a type (1 byte) and a body.
"""

from __future__ import annotations

import struct
from typing import Any

FORMATS = {
    "BOOL": "?",
    "UINT8": "B",
    "UINT32": "I",
    "INT32": "i",
    "UINT64": "Q",
    "DOUBLE": "d",
    "VECTOR3D": "3d",
    "VECTOR6D": "6d",
    "VECTOR6INT32": "6i",
}
"""Format of `struct` by the name of a type"""
UNKNOWN = "NOT_FOUND"
"""Type of a name that there is not"""

_NAMES = {
    "VECTOR6D": """target_q target_qd target_qdd target_current target_moment actual_q
        actual_qd actual_current actual_current_as_torque joint_control_output
        actual_TCP_pose actual_TCP_speed actual_TCP_force target_TCP_pose
        target_TCP_speed joint_temperatures actual_joint_voltage ft_raw_wrench
        payload_inertia external_force_torque""",
    "VECTOR3D": "actual_tool_accelerometer payload_cog elbow_position elbow_velocity",
    "VECTOR6INT32": "joint_mode",
    "UINT32": """runtime_state robot_status_bits safety_status_bits
        speed_slider_mask""",
    "INT32": "robot_mode safety_mode",
    "UINT64": "actual_digital_input_bits actual_digital_output_bits",
    "UINT8": """standard_digital_output_mask standard_digital_output
        standard_analog_output_mask standard_analog_output_type
        configurable_digital_output_mask configurable_digital_output
        tool_digital_output_mask tool_digital_output""",
    "DOUBLE": """timestamp actual_execution_time speed_scaling target_speed_fraction
        actual_momentum actual_main_voltage actual_robot_voltage actual_robot_current
        standard_analog_input0 standard_analog_input1 standard_analog_output0
        standard_analog_output1 payload speed_slider_fraction standard_analog_output_0
        standard_analog_output_1""",
}
TYPES = {name: kind for kind, names in _NAMES.items() for name in names.split()}
for _direction in ("input", "output"):
    for _index in range(48):
        TYPES[f"{_direction}_int_register_{_index}"] = "INT32"
        TYPES[f"{_direction}_double_register_{_index}"] = "DOUBLE"


class Recipe:
    """List of variables that a package of data holds, one after the other.

    Args:
        names: of the variables.
    """

    def __init__(self, names: list[str]) -> None:
        self.names = names
        self.types = [TYPES.get(name, UNKNOWN) for name in names]
        self.known = UNKNOWN not in self.types
        """True if there are all of them."""
        formats = [FORMATS[kind] for kind in self.types] if self.known else []
        self._format = struct.Struct(">" + "".join(formats))
        self._sizes = [int(f[0]) if len(f) > 1 else 1 for f in formats]

    @staticmethod
    def parse(text: bytes) -> Recipe:
        """Read a list of names, which may end with a comma."""
        return Recipe([name for name in text.decode().split(",") if name])

    def pack(self, values: dict[str, Any]) -> bytes:
        """Write values by name; those that are missing are 0."""
        numbers: list[Any] = []
        for name, size in zip(self.names, self._sizes, strict=True):
            value = values.get(name, 0)
            if size == 1:
                numbers.append(value)
            elif isinstance(value, int):
                numbers.extend([value] * size)
            else:
                numbers.extend(value)
        return self._format.pack(*numbers)

    def unpack(self, body: bytes) -> dict[str, Any]:
        """Read values by name.

        Raises:
            struct.error: another length.
        """
        numbers = iter(self._format.unpack(body))
        return {
            name: next(numbers) if size == 1 else [next(numbers) for _ in range(size)]
            for name, size in zip(self.names, self._sizes, strict=True)
        }


def package(kind: int, body: bytes) -> bytes:
    """Return a package of a type."""
    return struct.pack(">HB", len(body) + 3, kind) + body
