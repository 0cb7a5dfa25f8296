// SPDX-License-Identifier: Apache-2.0
// type_hashes.h — the type hashes of ROS 2 of the messages in ros_messages.idl. Written by
// type_hashes.py --header; a test computes them again.
#pragma once

namespace palpate::ros {

inline constexpr const char* kOperatingStateHash =
    "RIHS01_5cc57eea589b217fe5194bf2735b91d4a7f2dd5ac1245ae657f7ea7590c2c80e";
inline constexpr const char* kPoseStampedHash =
    "RIHS01_10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8";
inline constexpr const char* kTwistStampedHash =
    "RIHS01_5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64";
inline constexpr const char* kWrenchStampedHash =
    "RIHS01_8dc3deaf06b2ab281f9f9a742a8961c328ca7cec16e3fd6586d3a5c83fa78f77";
inline constexpr const char* kJointStateHash =
    "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e";
inline constexpr const char* kJoyHash =
    "RIHS01_0d356c79cad3401e35ffeb75a96a96e08be3ef896b8b83841d73e890989372c5";
inline constexpr const char* kFloat64Hash =
    "RIHS01_705ba9c3d1a09df43737eb67095534de36fd426c0587779bda2bc51fe790182a";
inline constexpr const char* kTFMessageHash =
    "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087";
inline constexpr const char* kMarkerHash =
    "RIHS01_45b13ccf791f225962bf74e746f9644518855d783a6f42ba0cc14fde2b4f3ce0";

}  // namespace palpate::ros
