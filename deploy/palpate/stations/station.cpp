// SPDX-License-Identifier: Apache-2.0
#include "deploy/palpate/stations/station.h"

#include <spdlog/fmt/fmt.h>

#include <algorithm>
#include <array>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <memory>
#include <utility>

#include "common/core/check.h"
#include "common/core/problems.h"
#include "common/telemetry/csv_writer.h"

namespace palpate {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using boost::system::error_code;
using nlohmann::json;

constexpr std::uint64_t kMostBytes = 1 << 20;
constexpr std::size_t kMostNews = 60;
constexpr double kMostShown = 1e6;  // of a number

/// One question to one station.
class Question : public std::enable_shared_from_this<Question> {
 public:
  Question(asio::io_context& io, const Station& station, Duration patience, StationAnswer& answer)
      : station_(station), answer_(answer), resolver_(io), stream_(io) {
    stream_.expires_after(std::chrono::duration_cast<std::chrono::milliseconds>(patience));
    answer_.problem = "does not answer";
    parser_.body_limit(kMostBytes);
    request_ = {http::verb::get, "/task", 11};
    request_.set(http::field::host, station.host + ":" + station.port);
    if (!station.token.empty()) {
      request_.set(http::field::authorization, "Bearer " + station.token);
    }
  }

  void begin() {
    resolver_.async_resolve(
        station_.host, station_.port,
        [self = shared_from_this()](const error_code& error, const auto& addresses) {
          if (error) return self->fail("no such host");
          self->stream_.async_connect(addresses, [self](const error_code& failed, const auto&) {
            if (failed) return self->fail("cannot be reached: " + failed.message());
            self->send();
          });
        });
  }

 private:
  void send() {
    http::async_write(stream_, request_,
                      [self = shared_from_this()](const error_code& error, std::size_t) {
                        if (error) return self->fail("does not answer");
                        http::async_read(self->stream_, self->buffer_, self->parser_,
                                         [self](const error_code& failed, std::size_t) {
                                           if (failed) return self->fail("does not answer");
                                           self->take(self->parser_.get());
                                         });
                      });
  }
  void take(const http::response<http::string_body>& response) {
    if (response.result() == http::status::unauthorized) return fail("needs its ?token=…");
    if (response.result() != http::status::ok) {
      return fail("answers " + std::to_string(response.result_int()));
    }
    json task = json::parse(response.body(), nullptr, false);
    if (!task.is_object() || !task.contains("task")) return fail("is no viewer_node");
    answer_ = {.task = std::move(task)};
  }
  void fail(const std::string& problem) { answer_.problem = one_line(problem); }

  const Station& station_;
  StationAnswer& answer_;
  asio::ip::tcp::resolver resolver_;
  beast::tcp_stream stream_;
  beast::flat_buffer buffer_;
  http::request<http::empty_body> request_;
  http::response_parser<http::string_body> parser_;
};

/// What is shown of a station.
struct Line {
  std::string state;
  std::string time;
  std::string marks;
  std::string coverage;
  std::string force;
  std::string news;
};

/// Null: `from` is no object, or has no such member.
const json& member(const json& from, const char* key) {
  static const json kNothing;
  const auto value = from.find(key);
  return value == from.end() ? kNothing : *value;
}

std::string number_text(const json& value, const char* form, double scale = 1.0) {
  if (!value.is_number()) return "";
  const double number = scale * value.get<double>();
  return std::abs(number) < kMostShown ? fmt::format(fmt::runtime(form), number) : "";
}

/// A station of a stranger may say anything, in any type.
std::string words(const json& value) {
  return value.is_string() ? one_line(value.get<std::string>()) : "";
}

Line line_of(const StationAnswer& answer) {
  Line line;
  if (!answer.task) {
    line.state = "absent";
    line.news = answer.problem;
    return line;
  }
  const json& task = (*answer.task)["task"];
  if (!task.is_object()) {
    line.state = "no task";
    return line;
  }
  line.state = words(member(task, "phase"));
  line.time = number_text(member(task, "elapsed_s"), "{:.0f}");
  line.marks = number_text(member(task, "marks"), "{:.0f}");
  const json& score = member(task, "score");
  line.coverage = number_text(member(score, "coverage_ratio"), "{:.0f}", 100.0);
  line.force = number_text(member(member(score, "force"), "most_n"), "{:.2f}");
  const json& findings = member(task, "findings");
  if (findings.is_array() && !findings.empty()) line.news = words(findings[0]).substr(0, kMostNews);
  return line;
}

}  // namespace

Station station_of(const std::string& text) {
  const auto refuse = [&] {
    return SetupError(
        "station " + one_line(text) +
        ": give the address of its page, http://HOST:PORT/?token=…, with NAME= before "
        "it if the host is not name enough");
  };
  constexpr std::string_view kScheme = "http://";
  const std::size_t scheme = text.find(kScheme);
  if (scheme == std::string::npos) throw refuse();
  Station station;
  if (scheme > 0) {
    if (scheme < 2 || text[scheme - 1] != '=') throw refuse();
    station.name = text.substr(0, scheme - 1);
  }
  const std::string rest = text.substr(scheme + kScheme.size());
  const std::string address = rest.substr(0, rest.find_first_of("/?"));
  // the port follows the last colon that is not inside [ ] of an IPv6 address
  const std::size_t colon = address.find(':', address.starts_with('[') ? address.find(']') : 0);
  station.host = address.substr(0, colon);
  if (colon != std::string::npos) station.port = address.substr(colon + 1);
  if (station.host.size() > 2 && station.host.front() == '[') {
    station.host = station.host.substr(1, station.host.size() - 2);
  }
  const bool has_port = !station.port.empty() && station.port.size() <= 5 &&
                        station.port.find_first_not_of("0123456789") == std::string::npos;
  if (station.host.empty() || !has_port) throw refuse();
  if (const std::size_t token = rest.find("token="); token != std::string::npos) {
    station.token = rest.substr(token + 6, rest.find_first_of("&#", token) - token - 6);
  }
  if (station.name.empty()) station.name = address;
  return station;
}

std::vector<StationAnswer> ask(const std::vector<Station>& stations, Duration patience) {
  std::vector<StationAnswer> answers(stations.size());
  asio::io_context io(1);
  for (std::size_t i = 0; i < stations.size(); ++i) {
    std::make_shared<Question>(io, stations[i], patience, answers[i])->begin();
  }
  io.run_for(patience + std::chrono::milliseconds(200));
  return answers;
}

std::string stations_text(const std::vector<Station>& stations,
                          const std::vector<StationAnswer>& answers) {
  std::size_t width = 7;
  for (const Station& one : stations) width = std::max(width, one.name.size());
  std::string text = fmt::format("{:<{}}  {:<8} {:>6} {:>6} {:>8} {:>7}  {}\n", "station", width,
                                 "task", "time s", "marks", "cover %", "Fmax N", "score");
  for (std::size_t i = 0; i < stations.size(); ++i) {
    const Line line = line_of(answers[i]);
    text += fmt::format("{:<{}}  {:<8} {:>6} {:>6} {:>8} {:>7}  {}\n", stations[i].name, width,
                        line.state, line.time, line.marks, line.coverage, line.force, line.news);
  }
  return text;
}

std::string stations_csv(const std::vector<Station>& stations,
                         const std::vector<StationAnswer>& answers) {
  std::string csv = "station,state,time_s,marks,coverage_percent,force_most_n,news\n";
  for (std::size_t i = 0; i < stations.size(); ++i) {
    const Line line = line_of(answers[i]);
    csv += fmt::format("{},{},{},{},{},{},{}\n", csv_cell(stations[i].name), csv_cell(line.state),
                       line.time, line.marks, line.coverage, line.force, csv_cell(line.news));
  }
  return csv;
}

std::string stations_json(const std::vector<Station>& stations,
                          const std::vector<StationAnswer>& answers) {
  json rows = json::array();
  for (std::size_t i = 0; i < stations.size(); ++i) {
    const Line line = line_of(answers[i]);
    rows.push_back({{"name", stations[i].name},
                    {"state", line.state},
                    {"cells", {line.time, line.marks, line.coverage, line.force, line.news}}});
  }
  return json{{"stations", rows}}.dump(-1, ' ', false, json::error_handler_t::replace);
}

}  // namespace palpate
