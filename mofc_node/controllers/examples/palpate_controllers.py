# SPDX-License-Identifier: Apache-2.0
"""The structs and functions of palpate_controllers.h for ctypes."""

from ctypes import CDLL, CFUNCTYPE, POINTER, Structure, c_char_p, c_double, c_int, c_size_t, c_void_p

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
    return library
