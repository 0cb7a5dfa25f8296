# SPDX-License-Identifier: Apache-2.0
"""The structs and functions of palpate_controllers.h for ctypes."""

from ctypes import (CDLL, CFUNCTYPE, POINTER, Structure, byref, c_char_p, c_double, c_int, c_size_t,
                    c_void_p, pointer)

Vector3 = c_double * 3
Numbers = POINTER(c_double)  # a callback gets a pointer where C says double[3]; Vector3 would be by value

# user, hand_position_m[3], hand_velocity_m_per_s[3], force_on_hand_newton[3] and stored_energy_joule[1] to set
Tissue = CFUNCTYPE(None, c_void_p, Numbers, Numbers, Numbers, Numbers)


class Stretch(Structure):
    _fields_ = [("duration_s", c_double), ("force_on_hand_newton", Vector3),
                ("hand_position_at_end_m", Vector3), ("is_end_unknown", c_int)]


class Input(Structure):
    _fields_ = [("hand_position_m", Vector3), ("hand_velocity_m_per_s", Vector3),
                ("applied", POINTER(Stretch)), ("applied_count", c_size_t), ("has_gap", c_int),
                ("acting_force_on_hand_newton", Vector3), ("acting_lease_s", c_double),
                ("requested_force_on_hand_newton", Vector3), ("is_request_held", c_int),
                ("stored_energy_joule", c_double), ("evaluated_at_m", Vector3),
                ("surface_normal", Vector3), ("tissue", Tissue), ("tissue_user", c_void_p)]


class Output(Structure):
    _fields_ = [("force_on_hand_newton", Vector3), ("f_max_newton", Vector3),
                ("ledger_energy_joule", c_double), ("lease_s", c_double),
                ("is_clamped", c_int), ("is_too_fast", c_int)]


PORTS = 8  # PALPATE_MOST_PORTS
Efforts = c_double * PORTS


class Port(Structure):
    _fields_ = [("viscous", c_double), ("coulomb", c_double), ("resolution", c_double),
                ("v_max", c_double), ("peak_effort", c_double), ("priority", c_int)]


class PortStretch(Structure):
    _fields_ = [("duration_s", c_double), ("effort_on_hand", Efforts),
                ("position_at_end", Efforts), ("is_end_unknown", c_int)]


class PortInput(Structure):
    _fields_ = [("position", Efforts), ("applied", POINTER(PortStretch)),
                ("applied_count", c_size_t), ("has_gap", c_int),
                ("acting_effort_on_hand", Efforts), ("acting_lease_s", c_double),
                ("requested_effort_on_hand", Efforts), ("is_request_held", c_int),
                ("stored_energy_joule", c_double)]


class PortOutput(Structure):
    _fields_ = [("effort_on_hand", Efforts), ("most_effort", Efforts),
                ("ledger_energy_joule", c_double), ("lease_s", c_double),
                ("begins_within_s", c_double), ("is_clamped", c_int), ("is_too_fast", c_int)]


class JointClamp:
    """Mode guard for the joints of a leader arm whose torque is set once per reading."""

    def __init__(self, library, ports, **settings):
        """ports: a Port each. settings: lease_s, credit_cap_joule, … of palpate_ports_set."""
        self._library = library
        self._ports = library.palpate_ports_create((Port * len(ports))(*ports), len(ports))
        if not self._ports:
            raise ValueError("a port has a number out of its range")
        for name, value in settings.items():
            if library.palpate_ports_set(self._ports, name.encode(), value) != 0:
                raise ValueError(f"{name} = {value}")
        self._count = len(ports)
        self._last = PortStretch()
        self._input = PortInput(applied=pointer(self._last))
        self.output = PortOutput()

    def step(self, position, requested, elapsed_s, is_known=True, stored_joule=0.0):
        """position: the readings now, in rad; requested: N·m on the hand; elapsed_s: since the step
        before; is_known: the last answer acted all that time, which it does not if that was longer
        than its lease; stored_joule: elastic energy behind the request, which it may give back.
        Returns what to send, in N·m."""
        step, last = self._input, self._last
        for i in range(self._count):
            step.position[i] = last.position_at_end[i] = position[i]
            step.requested_effort_on_hand[i] = requested[i]
        last.duration_s = elapsed_s
        step.stored_energy_joule = stored_joule
        is_leased = elapsed_s <= (1.0 + 1e-9) * self.output.lease_s
        step.has_gap = not (is_known and is_leased)
        status = self._library.palpate_ports_step(self._ports, byref(step), byref(self.output))
        step.applied_count = 1
        for i in range(self._count):  # all zero where the status is not 0
            last.effort_on_hand[i] = step.acting_effort_on_hand[i] = self.output.effort_on_hand[i]
        if status != 0:
            raise ValueError(f"palpate_ports_step: status {status}")
        return self.output.effort_on_hand[: self._count]

    def acts(self, effort):
        """What the motors made of the last answer, where they round it or cut it off."""
        for i in range(self._count):
            self._last.effort_on_hand[i] = self._input.acting_effort_on_hand[i] = effort[i]

    def __del__(self):
        if getattr(self, "_ports", None):
            self._library.palpate_ports_destroy(self._ports)
            self._ports = None


def load(path):
    library = CDLL(path)
    library.palpate_controller_create.argtypes = [c_char_p]
    library.palpate_controller_create.restype = c_void_p
    library.palpate_controller_error.restype = c_char_p
    library.palpate_controller_error.argtypes = [c_void_p]
    library.palpate_controller_set.argtypes = [c_void_p, c_char_p, c_double]
    library.palpate_controller_step.argtypes = [c_void_p, POINTER(Input), POINTER(Output)]
    library.palpate_controller_destroy.argtypes = [c_void_p]
    library.palpate_controller_destroy.restype = None
    library.palpate_ports_create.argtypes = [POINTER(Port), c_size_t]
    library.palpate_ports_create.restype = c_void_p
    library.palpate_ports_set.argtypes = [c_void_p, c_char_p, c_double]
    library.palpate_ports_step.argtypes = [c_void_p, POINTER(PortInput), POINTER(PortOutput)]
    library.palpate_ports_destroy.argtypes = [c_void_p]
    library.palpate_ports_destroy.restype = None
    return library
