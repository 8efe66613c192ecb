"""Real-time data exchange (RTDE): the protocol of port 30004, version 2.

A package consists of its size in bytes (2 bytes, big-endian), its type (1 byte) and a
body.
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
"""Format of `struct` by the name of a type."""
UNKNOWN, TAKEN = "NOT_FOUND", "IN_USE"
"""Types of an unknown name, and of an input that another client writes."""
Types = dict[str, str]
"""Types of variables by their names."""


def _types(names: dict[str, str], **registers: str) -> Types:
    """Return the types of variables and of 48 registers each."""
    found = {name: kind for kind, listed in names.items() for name in listed.split()}
    for stem, kind in registers.items():
        first = 64 if kind == "BOOL" else 0
        count = 64 if kind == "BOOL" else 48
        found |= {f"{stem}_{k}": kind for k in range(first, first + count)}
    return found


OUTPUTS = _types(
    {
        "VECTOR6D": """target_q target_qd target_qdd target_current target_moment
            actual_q actual_qd actual_current actual_current_window
            actual_current_as_torque joint_control_output actual_TCP_pose
            actual_TCP_speed actual_TCP_force target_TCP_pose target_TCP_speed
            joint_temperatures actual_joint_voltage ft_raw_wrench payload_inertia
            tcp_offset""",
        "VECTOR3D": """actual_tool_accelerometer payload_cog elbow_position
            elbow_velocity""",
        "VECTOR6INT32": "joint_mode",
        "UINT32": """runtime_state robot_status_bits safety_status_bits analog_io_types
            euromap67_input_bits euromap67_output_bits tool_mode
            tool_analog_input_types script_control_line
            output_bit_registers0_to_31 output_bit_registers32_to_63
            input_bit_registers0_to_31 input_bit_registers32_to_63""",
        "INT32": """robot_mode safety_mode safety_status tool_output_voltage
            time_scale_source encoder0_raw encoder1_raw""",
        "UINT64": "actual_digital_input_bits actual_digital_output_bits",
        "UINT8": """tool_output_mode tool_digital_output0_mode
            tool_digital_output1_mode""",
        "DOUBLE": """timestamp actual_execution_time speed_scaling
            target_speed_fraction actual_momentum actual_main_voltage
            actual_robot_voltage actual_robot_current standard_analog_input0
            standard_analog_input1 standard_analog_output0 standard_analog_output1
            io_current euromap67_24V_voltage euromap67_24V_current tool_analog_input0
            tool_analog_input1 tool_output_current tool_temperature tcp_force_scalar
            payload joint_position_deviation_ratio collision_detection_ratio""",
    },
    output_bit_register="BOOL",
    input_bit_register="BOOL",
    output_int_register="INT32",
    input_int_register="INT32",
    output_double_register="DOUBLE",
    input_double_register="DOUBLE",
)
"""Types of the variables that a controller sends."""
INPUTS = _types(
    {
        "UINT32": """speed_slider_mask input_bit_registers0_to_31
            input_bit_registers32_to_63""",
        "UINT8": """standard_digital_output_mask standard_digital_output
            configurable_digital_output_mask configurable_digital_output
            tool_digital_output_mask tool_digital_output standard_analog_output_mask
            standard_analog_output_type""",
        "DOUBLE": """speed_slider_fraction standard_analog_output_0
            standard_analog_output_1""",
        "VECTOR6D": "external_force_torque",
    },
    input_bit_register="BOOL",
    input_int_register="INT32",
    input_double_register="DOUBLE",
)
"""Types of the variables that a client may write."""


class Recipe:
    """List of the variables in a data package, in their order.

    Args:
        text: Names of the variables, separated by commas.
        known: Types of all variables, by name.

    Raises:
        UnicodeDecodeError: The names are not UTF-8 text.
    """

    def __init__(self, text: bytes, known: Types) -> None:
        self.names = [name for name in text.decode().split(",") if name]
        self.types = [known.get(name, UNKNOWN) for name in self.names]
        self.known = UNKNOWN not in self.types
        """True if all variables are known."""
        formats = [FORMATS[kind] for kind in self.types] if self.known else []
        self._format = struct.Struct(">" + "".join(formats))
        self._sizes = [int(f[0]) if len(f) > 1 else 1 for f in formats]

    def pack(self, values: dict[str, Any]) -> bytes:
        """Return the bytes of values by name; missing values are 0."""
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
        """Return the values by name.

        Raises:
            struct.error: The body has another length.
        """
        numbers = iter(self._format.unpack(body))
        return {
            name: next(numbers) if size == 1 else [next(numbers) for _ in range(size)]
            for name, size in zip(self.names, self._sizes, strict=True)
        }


def package(kind: int, body: bytes) -> bytes:
    """Return a package of a type."""
    return struct.pack(">HB", len(body) + 3, kind) + body


def text_message(text: str) -> bytes:
    """Return the package by which a controller reports an error to a client."""
    words, source = text.encode()[:255], b"RTDE"
    body = bytes([len(words)]) + words + bytes([len(source)]) + source + b"\x00"
    return package(ord("M"), body)
