# SPDX-License-Identifier: Apache-2.0
# Debian 12 packages only; nothing is downloaded. The table in docs/developing.md says what each is for.

find_package(Threads REQUIRED)
find_package(Eigen3 3.4 REQUIRED NO_MODULE)   # Eigen3::Eigen
find_package(Protobuf 3.21 REQUIRED)          # protobuf::libprotobuf, protobuf_generate()
find_package(cppzmq REQUIRED)                 # cppzmq
find_package(spdlog REQUIRED)                 # spdlog::spdlog
find_package(CLI11 REQUIRED)                  # CLI11::CLI11
find_package(nlohmann_json REQUIRED)          # nlohmann_json::nlohmann_json
find_package(EXPAT REQUIRED)                  # EXPAT::EXPAT
find_package(ZLIB REQUIRED)                   # ZLIB::ZLIB (CRC-32, gzip)
find_package(Boost 1.74 REQUIRED COMPONENTS filesystem)  # Boost::headers (Asio, Process, Beast)

# DDS, for `palpate ros` only: a program of its own, which no other one links.
option(PALPATE_ROS "Build palpate_ros, topics of ROS 2 by DDS (needs cyclonedds-dev, cyclonedds-tools)" OFF)
set(PALPATE_HAS_DDS OFF)
if(PALPATE_ROS OR PALPATE_BUILD_TESTS)
  find_path(PALPATE_DDS_INCLUDE dds/dds.h)
  find_library(PALPATE_DDSC ddsc)
  find_program(PALPATE_IDLC idlc)
  if(PALPATE_DDS_INCLUDE AND PALPATE_DDSC AND PALPATE_IDLC)
    set(PALPATE_HAS_DDS ON)
  elseif(PALPATE_ROS)
    message(FATAL_ERROR "PALPATE_ROS needs Cyclone DDS: apt-get install cyclonedds-dev cyclonedds-tools")
  endif()
endif()
