// SPDX-License-Identifier: Apache-2.0
// hd.h — STUB of the few functions of OpenHaptics that openhaptics_callback.h uses. Not
// OpenHaptics.
#pragma once

#define HDCALLBACK
#define HD_CURRENT_POSITION 0x2050
#define HD_CURRENT_FORCE 0x2700
#define HD_INSTANTANEOUS_UPDATE_RATE 0x2152
#define HD_CALLBACK_CONTINUE 1

using HHD = unsigned int;
using HDint = int;
using HDCallbackCode = unsigned int;

HHD hdGetCurrentDevice();
void hdBeginFrame(HHD device);
void hdEndFrame(HHD device);
void hdGetIntegerv(unsigned int name, HDint* value);
void hdGetDoublev(unsigned int name, double* values);
void hdSetDoublev(unsigned int name, const double* values);
