// SPDX-License-Identifier: Apache-2.0
#include "physics_node/elastic/condensed/compliance_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <random>
#include <span>
#include <stdexcept>
#include <system_error>
#include <utility>
#include <vector>

namespace palpate::elastic {
namespace {

constexpr std::uint64_t kMagic = 0x31504d4f43504c50;  // "PLPCOMP1" in the byte order of the writer
constexpr std::uint64_t kVersion = 4;  // of the format and of how columns are computed

// FNV-1a over words of eight bytes, with a shift so that high bits reach low ones.
class Hash {
 public:
  void add(std::uint64_t word) {
    value_ = (value_ ^ word) * 0x100000001b3U;
    value_ ^= value_ >> 29U;
  }
  void add(double number) {
    std::uint64_t word = 0;
    std::memcpy(&word, &number, sizeof word);
    add(word);
  }
  void add_bytes(std::span<const char> bytes) {
    for (std::size_t i = 0; i < bytes.size(); i += 8) {
      std::uint64_t word = 0;
      std::memcpy(&word, bytes.data() + i, std::min<std::size_t>(8, bytes.size() - i));
      add(word);
    }
    add(std::uint64_t{bytes.size()});
  }
  [[nodiscard]] std::uint64_t value() const { return value_; }

 private:
  std::uint64_t value_ = 0xcbf29ce484222325U;
};

struct Header {
  std::uint64_t magic = kMagic;
  std::uint64_t version = kVersion;
  std::uint64_t fingerprint = 0;
  std::uint64_t rows = 0;  // nodes of the surface
  std::uint64_t columns = 0;
  std::uint64_t hash = 0;  // of what follows: per column its node as a word, then 9 floats per row
};

[[noreturn]] void fail(const std::filesystem::path& file, const char* what) {
  const int reason = errno;
  throw std::runtime_error(file.string() + ": " + what + ": " +
                           std::system_category().message(reason));
}

/// Never through a link, and never a pipe, which would wait for its other end.
class OpenFile {
 public:
  /// A file that is not there yet. One that a program with the same number has left is removed.
  static OpenFile created(const std::filesystem::path& file) {
    constexpr int kFlags = O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC;
    int descriptor = ::open(file.c_str(), kFlags, 0600);
    if (descriptor < 0 && errno == EEXIST && ::unlink(file.c_str()) == 0) {
      descriptor = ::open(file.c_str(), kFlags, 0600);
    }
    if (descriptor < 0) fail(file, "cannot be created");
    return OpenFile(descriptor);
  }
  /// A file of this user that nobody else may write.
  /// @param why  set if there is none
  static OpenFile kept(const std::filesystem::path& file, std::string& why) {
    OpenFile opened(::open(file.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
    if (opened.descriptor_ < 0 || ::fstat(opened.descriptor_, &opened.status_) != 0) {
      why = "there is no such file, or it is a link, or it cannot be read";
    } else if (!S_ISREG(opened.status_.st_mode)) {
      why = "it is not a regular file";
    } else if (opened.status_.st_uid != ::geteuid() ||
               (opened.status_.st_mode & (S_IWGRP | S_IWOTH)) != 0) {
      why = "another user may have written it";
    }
    return opened;
  }
  ~OpenFile() {
    if (descriptor_ >= 0) ::close(descriptor_);
  }
  OpenFile(OpenFile&& other) noexcept
      : descriptor_(std::exchange(other.descriptor_, -1)), status_(other.status_) {}
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;

  [[nodiscard]] std::uint64_t size() const { return static_cast<std::uint64_t>(status_.st_size); }
  /// All of it, or false.
  [[nodiscard]] bool read(std::span<char> bytes) const {
    while (!bytes.empty()) {
      const ssize_t count = ::read(descriptor_, bytes.data(), bytes.size());
      if (count < 0 && errno == EINTR) continue;
      if (count <= 0) return false;
      bytes = bytes.subspan(static_cast<std::size_t>(count));
    }
    return true;
  }
  [[nodiscard]] bool write(std::span<const char> bytes) const {
    while (!bytes.empty()) {
      const ssize_t written = ::write(descriptor_, bytes.data(), bytes.size());
      if (written < 0 && errno == EINTR) continue;
      if (written <= 0) return false;
      bytes = bytes.subspan(static_cast<std::size_t>(written));
    }
    return true;
  }
  [[nodiscard]] bool finish() {
    const bool is_synced = ::fsync(descriptor_) == 0;
    const bool is_closed = ::close(descriptor_) == 0;
    descriptor_ = -1;
    return is_synced && is_closed;
  }

 private:
  explicit OpenFile(int descriptor) : descriptor_(descriptor) {}

  int descriptor_;
  struct stat status_ {};
};

}  // namespace

std::uint64_t fingerprint_of(const SurfaceCompliance& compliance) {
  const BodyDescription& body = compliance.body().description();
  Hash hash;
  hash.add(kVersion);
  hash.add(static_cast<std::uint64_t>(body.law));
  hash.add(static_cast<std::uint64_t>(body.mesh.nodes_per_element));
  for (const Vector3d& node : body.mesh.nodes_m) {
    for (const double coordinate : node) hash.add(coordinate);
  }
  hash.add(std::uint64_t{body.mesh.nodes_m.size()});
  for (const std::uint32_t node : body.mesh.elements) hash.add(std::uint64_t{node});
  hash.add(std::uint64_t{body.mesh.elements.size()});
  for (const std::uint8_t region : body.mesh.regions) hash.add(std::uint64_t{region});
  hash.add(std::uint64_t{body.mesh.regions.size()});
  for (const Material& material : body.materials) {
    hash.add(material.young_modulus_pa);
    hash.add(material.poisson_ratio);
    hash.add(material.density_kg_per_m3);
  }
  hash.add(std::uint64_t{body.materials.size()});
  for (const std::uint32_t node : body.fixed_nodes) hash.add(std::uint64_t{node});
  hash.add(std::uint64_t{body.fixed_nodes.size()});
  for (const Attachment& attachment : body.attachments) {
    hash.add(std::uint64_t{attachment.node});
    hash.add(attachment.stiffness_newton_per_m);
  }
  hash.add(std::uint64_t{body.attachments.size()});
  for (const std::uint32_t node : compliance.surface_nodes()) hash.add(std::uint64_t{node});
  return hash.value();
}

std::filesystem::path compliance_file(const std::filesystem::path& folder,
                                      const SurfaceCompliance& compliance) {
  std::array<char, 32> name{};
  static_cast<void>(std::snprintf(name.data(), name.size(), "%016llx.compliance",
                                  static_cast<unsigned long long>(fingerprint_of(compliance))));
  return folder / name.data();
}

void save_columns(const SurfaceCompliance& compliance, const std::filesystem::path& file) {
  const std::size_t rows = compliance.surface_nodes().size();
  const std::size_t column_bytes = sizeof(std::uint64_t) + 9 * rows * sizeof(float);
  std::vector<char> bytes(compliance.all_columns().size() * column_bytes);
  char* to = bytes.data();
  for (const auto& [node, values] : compliance.all_columns()) {
    const std::uint64_t word = node;
    std::memcpy(to, &word, sizeof word);
    std::memcpy(to + sizeof word, values->data(), column_bytes - sizeof word);
    to += column_bytes;
  }
  Hash hash;
  hash.add_bytes(bytes);
  const Header header{.fingerprint = fingerprint_of(compliance),
                      .rows = rows,
                      .columns = compliance.all_columns().size(),
                      .hash = hash.value()};
  // two programs may write at once: each its own file
  std::filesystem::path part = file;
  part += '.';
  part += std::to_string(::getpid());
  part += ".part";
  try {
    OpenFile out = OpenFile::created(part);
    const bool is_written =
        out.write(std::span(reinterpret_cast<const char*>(&header), sizeof header)) &&
        out.write(bytes);
    if (!is_written || !out.finish()) fail(part, "cannot be written");
    if (std::rename(part.c_str(), file.c_str()) != 0) fail(file, "cannot be replaced");
  } catch (...) {
    ::unlink(part.c_str());
    throw;
  }
}

std::string load_columns(const std::filesystem::path& file, SurfaceCompliance& compliance) {
  std::string why;
  const OpenFile in = OpenFile::kept(file, why);
  if (!why.empty()) return why;
  Header header;
  if (!in.read(std::span(reinterpret_cast<char*>(&header), sizeof header))) {
    return "it is cut short";
  }
  if (header.magic != kMagic) return "it is not a compliance of this program and processor";
  if (header.version != kVersion) return "it has version " + std::to_string(header.version);
  if (header.fingerprint != fingerprint_of(compliance)) return "it belongs to another body";
  const std::size_t rows = compliance.surface_nodes().size();
  if (header.rows != rows || header.columns > compliance.body().node_count()) {
    return "its size does not fit the body";
  }
  const std::size_t column_bytes = sizeof(std::uint64_t) + 9 * rows * sizeof(float);
  // before anything of this size is allocated
  if (in.size() != sizeof header + header.columns * column_bytes) {
    return "it is cut short or too long";
  }
  std::vector<char> bytes(header.columns * column_bytes);
  if (!in.read(bytes)) return "it is cut short";
  Hash hash;
  hash.add_bytes(bytes);
  if (hash.value() != header.hash) return "it is damaged";
  SurfaceCompliance::Columns columns;
  for (const char* from = bytes.data(); from != bytes.data() + bytes.size(); from += column_bytes) {
    std::uint64_t node = 0;
    std::memcpy(&node, from, sizeof node);
    std::vector<float> values(9 * rows);
    std::memcpy(values.data(), from + sizeof node, column_bytes - sizeof node);
    if (node >= compliance.body().node_count()) return "it is damaged";
    for (const float value : values) {
      if (!std::isfinite(value)) return "it is damaged";
    }
    columns.emplace(static_cast<std::uint32_t>(node),
                    std::make_shared<const std::vector<float>>(std::move(values)));
  }
  // whoever can write the file can also write its hash
  std::vector<std::uint32_t> sample;
  std::mt19937 random{std::random_device{}()};
  for (const auto& [node, values] : columns) sample.push_back(node);
  std::shuffle(sample.begin(), sample.end(), random);
  sample.resize(std::min(sample.size(), WarpedFactor::kMostColumns));
  if (!compliance.confirms(columns, sample)) return "its columns are not those of this body";
  compliance.set_columns(std::move(columns));
  return {};
}

}  // namespace palpate::elastic
