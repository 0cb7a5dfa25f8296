# SPDX-License-Identifier: Apache-2.0
"""The structs and functions of palpate_controllers.h and palpate_leader.h for ctypes."""

from ctypes import (CDLL, CFUNCTYPE, POINTER, Structure, byref, c_char_p, c_double, c_int, c_size_t,
                    c_uint, c_ulonglong, c_void_p, create_string_buffer, pointer)
from warnings import warn

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


def _check_names(kind, given, known):
    """ctypes takes any keyword: one that is misspelt would leave its field at 0."""
    for name in given:
        if name not in known:
            raise TypeError(f"{kind.__name__} has no {name!r}; it has {', '.join(known)}")


class _Named(Structure):
    """A struct that refuses keywords that are none of its fields."""

    def __init__(self, *values, **named):
        _check_names(type(self), named, [name for name, _ in self._fields_])
        super().__init__(*values, **named)


class Port(_Named):
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

    def __init__(self, library, ports, lease_s=0.002, earliest_end_s=None, delay_s=None, **settings):
        """ports: a Port each. settings: credit_cap_joule, … of palpate_ports_set.
        lease_s: the motors end a torque by themselves after this at the latest. earliest_end_s: and no
        earlier than after this; half of lease_s if it is not given. delay_s: a torque acts this long
        after the reading that it answers, at the latest; half of earliest_end_s if it is not given.
        The times of a leader of this module are leader.clamp_times."""
        self._library, self._ports = library, None
        made = (Port * len(ports))(*ports)
        error = create_string_buffer(200)
        if not library.palpate_ports_check(made, len(ports), error, len(error)):
            raise ValueError(error.value.decode())
        self._end_s = 0.5 * lease_s if earliest_end_s is None else earliest_end_s
        self._delay_s = 0.5 * self._end_s if delay_s is None else delay_s
        if not 0.0 <= self._delay_s < self._end_s <= max(lease_s, settings.get("longest_lease_s", 0.0)):
            raise ValueError(f"delay_s = {self._delay_s}, earliest_end_s = {self._end_s}, lease_s = {lease_s}: "
                             "must be 0 <= delay_s < earliest_end_s <= lease_s")
        for port in made:  # a reading is then right to half of it also where the torque begins
            port.resolution += 2.0 * port.v_max * self._delay_s
        self._ports = library.palpate_ports_create(made, len(ports))
        if not self._ports:
            raise MemoryError
        for name, value in {"lease_s": lease_s, **settings}.items():
            if library.palpate_ports_set(self._ports, name.encode(), value) != 0:
                raise ValueError(self._error())
        self._count = len(ports)
        # of a torque that came late: how long the one before went on, then itself
        self._echo = (PortStretch * 2)(PortStretch(is_end_unknown=1))
        self._last = self._echo[1]
        self._late_s, self._is_known = 0.0, True
        self._input = PortInput(applied=pointer(self._last))
        self.output = PortOutput()
        self.gaps = 0  # steps that cost the credit, as it was not known what had acted
        self._long_s = []  # of periods in a row that were too long

    def _error(self):
        return self._library.palpate_ports_error(self._ports).decode()

    def _check_count(self, **lists):
        for name, values in lists.items():
            if len(values) != self._count:
                raise ValueError(f"{name} has {len(values)} numbers; the clamp has {self._count} ports")

    def _note_period(self, elapsed_s, is_short):
        """Without this word a loop that is too slow for its lease has no force, and nobody knows why."""
        if is_short or self._long_s is None or not self._input.applied_count:
            self._long_s = None if self._long_s is None else []
            return
        self._long_s.append(elapsed_s)
        if len(self._long_s) == 20:
            warn(f"no torque beyond friction: elapsed_s + delay_s = {min(self._long_s):g} + {self._delay_s:g} s or "
                 f"more, beyond earliest_end_s = {self._end_s:g} s. Say delay_s and earliest_end_s as they are, or "
                 "make the loop faster or the lease longer", RuntimeWarning, stacklevel=3)
            self._long_s = None

    def step(self, position, requested, elapsed_s, is_known=True, stored_joule=0.0):
        """position: the readings now, in rad; requested: N·m on the hand; elapsed_s: since the reading
        before; is_known: the last answer acted all that time; stored_joule: elastic energy behind the
        request, which it may give back. Returns what to send, in N·m."""
        self._check_count(position=position, requested=requested)
        step, last = self._input, self._last
        for i in range(self._count):
            step.position[i] = last.position_at_end[i] = position[i]
            step.requested_effort_on_hand[i] = requested[i]
        last.duration_s = elapsed_s + self._delay_s if elapsed_s >= 0.0 else elapsed_s
        step.stored_energy_joule = stored_joule
        # beyond this it is not known where the motors have let go
        end_s = min(self._end_s, self.output.lease_s)
        step.has_gap = not (is_known and self._is_known and last.duration_s <= (1.0 + 1e-9) * end_s)
        self._note_period(elapsed_s, last.duration_s <= (1.0 + 1e-9) * end_s)
        self._echo[0].duration_s = self._late_s
        step.applied = pointer(self._echo[0] if self._late_s > 0.0 else last)
        if step.applied_count:
            step.applied_count = 2 if self._late_s > 0.0 else 1
            self.gaps += step.has_gap
        status = self._library.palpate_ports_step(self._ports, byref(step), byref(self.output))
        step.applied_count = 1
        self._late_s, self._is_known = 0.0, True
        for i in range(self._count):  # all zero where the status is not 0
            self._echo[0].effort_on_hand[i] = last.effort_on_hand[i]
            last.effort_on_hand[i] = step.acting_effort_on_hand[i] = self.output.effort_on_hand[i]
        if status != 0:
            raise ValueError(self._error())
        return self.output.effort_on_hand[: self._count]

    def acts(self, effort, delay_s=None):
        """What the motors made of the last answer, where they round it or cut it off; and how long after
        the reading it was with them. One later than promised costs what the one before may have drawn."""
        self._check_count(effort=effort)
        for i in range(self._count):
            self._last.effort_on_hand[i] = self._input.acting_effort_on_hand[i] = effort[i]
        if delay_s is not None and not delay_s <= self._delay_s:
            self._is_known = delay_s > self._delay_s and any(effort)
            self._late_s = delay_s - self._delay_s if self._is_known else 0.0

    def __del__(self):
        if getattr(self, "_ports", None):
            self._library.palpate_ports_destroy(self._ports)
            self._ports = None


class JointPlace(_Named):
    """How a joint lies to its motor: palpate_leader.h."""
    _fields_ = [("sign", c_double), ("offset_rad", c_double), ("gear", c_double),
                ("lowest_rad", c_double), ("highest_rad", c_double),
                ("fastest_rad_per_s", c_double), ("play_rad", c_double)]
    _defaults = {"sign": 1.0, "gear": 1.0, "lowest_rad": -1.5, "highest_rad": 1.5,
                 "fastest_rad_per_s": 6.0}


class LeaderTimes(_Named):
    _fields_ = [("answer_limit_s", c_double), ("longest_delay_s", c_double),
                ("longest_cycle_s", c_double)]
    _defaults = {"answer_limit_s": 0.010, "longest_delay_s": 0.006, "longest_cycle_s": 0.020}


class _Placed(_Named):
    """A motor and its joint: the fields of JointPlace are given, and read, as its own."""

    def __init__(self, id, **values):
        names = [name for name, _ in JointPlace._fields_]
        _check_names(type(self), values,
                     [name for name, _ in self._fields_ if name not in ("id", "place")] + names)
        place = {name: values.pop(name) for name in names if name in values}
        super().__init__(id=id, place=JointPlace(**{**JointPlace._defaults, **place}),
                         **{**self._defaults, **values})

    def __getattr__(self, name):
        return getattr(self.place, name)


class DynamixelJoint(_Placed):
    """One servo on a Dynamixel bus and the joint that it drives."""
    _fields_ = [("id", c_int), ("place", JointPlace), ("torque_newton_m_per_ampere", c_double),
                ("current_limit_ampere", c_double)]
    _defaults = {}


class DamiaoJoint(_Placed):
    """One Damiao motor on a CAN bus, as in OpenArm, and the joint that it drives."""
    _fields_ = [("id", c_int), ("place", JointPlace), ("feedback_id", c_int), ("model", c_char_p),
                ("torque_limit_newton_m", c_double), ("torque_ratio", c_double)]
    _defaults = {"torque_ratio": 1.0}

    def __init__(self, id, model, **values):
        super().__init__(id, model=model.encode(), **values)


class DynamixelSettings(_Named):
    _fields_ = [("port", c_char_p), ("times", LeaderTimes), ("bits_per_second", c_uint),
                ("watchdog_units", c_int), ("may_write_eeprom", c_int)]
    _defaults = {"bits_per_second": 1_000_000, "watchdog_units": 1}


class DamiaoSettings(_Named):
    _fields_ = [("port", c_char_p), ("times", LeaderTimes), ("is_fd", c_int),
                ("timeout_s", c_double)]
    _defaults = {"is_fd": 1, "timeout_s": 0.020}


class LeaderReading(Structure):
    _fields_ = [("position_rad", Efforts), ("velocity_rad_per_s", Efforts),
                ("torque_newton_m", Efforts), ("elapsed_s", c_double), ("is_known", c_int),
                ("repeated", c_ulonglong)]


class LeaderFault(RuntimeError):
    """The arm is limp; the text says which joint, and why. Make a new leader."""


class _Leader:
    """A motorised leader arm, limp until enable(). Never run on hardware."""

    def __init__(self, library, joints, port, **settings):
        """joints: one each. settings: of LeaderTimes and of the bus."""
        self._library, self._handle = library, None
        _check_names(type(self), settings,
                     [name for name, _ in self._settings._fields_ if name not in ("port", "times")]
                     + list(LeaderTimes._defaults))
        times = {name: settings.pop(name) for name in LeaderTimes._defaults if name in settings}
        made = self._settings(port=port.encode(),
                              times=LeaderTimes(**{**LeaderTimes._defaults, **times}),
                              **{**self._settings._defaults, **settings})
        error = create_string_buffer(400)
        self._handle = getattr(library, self._open)(
            (self._joint * len(joints))(*joints), len(joints), byref(made), error, len(error))
        if not self._handle:
            raise LeaderFault(error.value.decode())
        self.count = len(joints)
        self.lease_s = library.palpate_leader_lease_s(self._handle)
        self.description = library.palpate_leader_description(self._handle).decode()
        # for JointClamp: delays are in resolution_rad() and in elapsed_s, and a watchdog that has ended a
        # torque is a fault
        self.clamp_times = {"lease_s": self.lease_s, "earliest_end_s": self.lease_s, "delay_s": 0.0}
        self._torque, self._made = Efforts(), Efforts()
        self.reported_newton_m = [0.0] * self.count

    def resolution_rad(self, joint):
        """That of the clamp's port."""
        return self._library.palpate_leader_resolution_rad(self._handle, joint)

    def largest_torque_newton_m(self, joint):
        return self._library.palpate_leader_largest_torque_newton_m(self._handle, joint)

    def _check(self, is_good):
        if not is_good:
            raise LeaderFault(self._library.palpate_leader_error(self._handle).decode())

    def enable(self):
        """The person holds the arm. From now on each motor's watchdog counts."""
        self._check(self._library.palpate_leader_enable(self._handle))

    def read(self):
        """Returns (angles in rad, elapsed_s, is_known), as JointClamp.step() wants them."""
        reading = LeaderReading()
        self._check(self._library.palpate_leader_read(self._handle, byref(reading)))
        self.reported_newton_m = reading.torque_newton_m[: self.count]  # by what they measure
        return reading.position_rad[: self.count], reading.elapsed_s, bool(reading.is_known)

    def write(self, torque):
        """Returns what the motors are to make of it, in N·m: 0 before enable(). reported_newton_m says what
        they made of the one before, by their own measure."""
        self._torque[: self.count] = torque
        self._check(self._library.palpate_leader_write(self._handle, self._torque, self._made))
        return self._made[: self.count]

    def release(self):
        """No torque, then the motors off."""
        self._library.palpate_leader_release(self._handle)

    def close(self):
        if self._handle:
            self._library.palpate_leader_close(self._handle)
            self._handle = None

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    __del__ = close


class DynamixelLeader(_Leader):
    """On a Dynamixel bus: joints are DynamixelJoint, port is a serial line."""
    _joint, _settings, _open = DynamixelJoint, DynamixelSettings, "palpate_leader_open_dynamixel"


class DamiaoLeader(_Leader):
    """Damiao motors, as in OpenArm: joints are DamiaoJoint, port is a CAN interface."""
    _joint, _settings, _open = DamiaoJoint, DamiaoSettings, "palpate_leader_open_damiao"


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
    library.palpate_ports_check.argtypes = [POINTER(Port), c_size_t, c_char_p, c_size_t]
    library.palpate_ports_error.argtypes = [c_void_p]
    library.palpate_ports_error.restype = c_char_p
    library.palpate_ports_destroy.argtypes = [c_void_p]
    library.palpate_ports_destroy.restype = None
    for bus in (DynamixelLeader, DamiaoLeader):
        opens = getattr(library, bus._open)
        opens.argtypes = [POINTER(bus._joint), c_size_t, POINTER(bus._settings), c_char_p, c_size_t]
        opens.restype = c_void_p
    library.palpate_leader_read.argtypes = [c_void_p, POINTER(LeaderReading)]
    library.palpate_leader_write.argtypes = [c_void_p, Numbers, Numbers]
    for name in ("enable", "release", "close", "error", "description", "lease_s"):
        getattr(library, f"palpate_leader_{name}").argtypes = [c_void_p]
    for name in ("release", "close"):
        getattr(library, f"palpate_leader_{name}").restype = None
    for name in ("error", "description"):
        getattr(library, f"palpate_leader_{name}").restype = c_char_p
    for name in ("resolution_rad", "largest_torque_newton_m"):
        getattr(library, f"palpate_leader_{name}").argtypes = [c_void_p, c_size_t]
        getattr(library, f"palpate_leader_{name}").restype = c_double
    library.palpate_leader_lease_s.restype = c_double
    return library
