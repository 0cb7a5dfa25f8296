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
#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "common/core/check.h"
#include "common/core/problems.h"
#include "common/core/user/utf8.h"
#include "common/telemetry/csv_writer.h"

namespace palpate {
namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace http = beast::http;
using boost::system::error_code;
using nlohmann::json;

constexpr std::uint64_t kMostBytes = 1 << 20;
constexpr std::size_t kMostNews = 60;  // characters in a terminal
constexpr double kMostShown = 1e6;     // of a number

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
    if (response.result() == http::status::unauthorized) {
      return fail(station_.token.empty() ? "needs its ?token=…" : "its token is another one");
    }
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
  std::string missing;  ///< share of the measurements, in percent
  std::string news;
};

/// Null: `from` is no object, or has no such member.
const json& member(const json& from, const char* key) {
  static const json kNothing;
  const auto value = from.find(key);
  return value == from.end() ? kNothing : *value;
}

/// Thrown where a station says what no viewer_node says.
struct NotUnderstood {
  std::string reason;
};

/// Empty: null, or not said.
std::string number_text(const json& from, const char* key, const char* form, double scale = 1.0) {
  const json& value = member(from, key);
  if (value.is_null()) return "";
  if (!value.is_number()) throw NotUnderstood{fmt::format("{} is no number", key)};
  const double number = scale * value.get<double>();
  if (!(std::abs(number) < kMostShown)) throw NotUnderstood{fmt::format("{} is too large", key)};
  return fmt::format(fmt::runtime(form), number);
}

/// Null: not said.
const json& object(const json& from, const char* key) {
  const json& value = member(from, key);
  if (!value.is_object() && !value.is_null()) {
    throw NotUnderstood{fmt::format("{} is no object", key)};
  }
  return value;
}

std::string phase_of(const json& task) {
  constexpr std::array<const char*, 3> kPhases{"waiting", "running", "ended"};
  const json& phase = member(task, "phase");
  if (!phase.is_string()) throw NotUnderstood{"phase is no word"};
  const auto& word = phase.get_ref<const std::string&>();
  if (std::find(kPhases.begin(), kPhases.end(), word) == kPhases.end()) {
    throw NotUnderstood{fmt::format("phase is \"{}\"", one_line(word))};
  }
  return word;
}

/// What was found where lesions were searched, else the first sentence that is about the task, not
/// about its measurements. Empty: nothing is said yet.
std::string result_of(const json& task, const json& score) {
  const json& targets = member(score, "targets");
  const json& found = member(score, "found");
  if (targets.is_array() && !targets.empty() && found.is_number_unsigned()) {
    return fmt::format("Found {} of {}.", found.get<std::uint64_t>(), targets.size());
  }
  const json& findings = member(task, "findings");
  if (!findings.is_array() && !findings.is_null()) throw NotUnderstood{"findings is no list"};
  for (const json& finding : findings) {
    if (!finding.is_string()) throw NotUnderstood{"findings has more than sentences"};
    std::string sentence = one_line(finding.get_ref<const std::string&>());
    if (sentence.find("measurements") == std::string::npos) return sentence;
  }
  return "";
}

Line line_of_task(const json& task) {
  const json& score = object(task, "score");
  return {.state = phase_of(task),
          .time = number_text(task, "elapsed_s", "{:.0f}"),
          .marks = number_text(task, "marks", "{:.0f}"),
          .coverage = number_text(score, "coverage_ratio", "{:.0f}", 100.0),
          .force = number_text(object(score, "force"), "most_n", "{:.2f}"),
          .missing = number_text(score, "missing_ratio", "{:.3g}", 100.0),
          .news = result_of(task, score)};
}

/// A station of a stranger may say anything, in any type.
Line line_of(const StationAnswer& answer) {
  Line line;
  try {
    if (!answer.task) {
      line.state = "absent";
      line.news = answer.problem;
    } else if (const json& task = object(*answer.task, "task"); task.is_null()) {
      line.state = "no task";
    } else {
      line = line_of_task(task);
    }
  } catch (const NotUnderstood& what) {
    line.state = "not understood";
    line.news = what.reason;
  }
  return line;
}

/// Of a terminal's line: at most kMostNews characters, cut between words.
std::string shortened(const std::string& text) {
  std::size_t characters = 0;
  std::size_t end = 0;  // of the last word that leaves room for the ellipsis
  std::size_t cut = 0;  // where there is no such word
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (!begins_character(text[i])) continue;
    if (text[i] == ' ' && characters < kMostNews) end = i;
    if (characters + 1 == kMostNews) cut = i;
    ++characters;
  }
  if (characters <= kMostNews) return text;
  return text.substr(0, end > 0 ? end : cut) + "…";
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
  const bool is_number = !station.port.empty() && station.port.size() <= 5 &&
                         station.port.find_first_not_of("0123456789") == std::string::npos;
  const int port = is_number ? std::stoi(station.port) : 0;
  if (station.host.empty() || port < 1 || port > 65535) throw refuse();
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
  std::vector<Line> lines;
  std::size_t width = 7;
  std::size_t state_width = 8;
  for (std::size_t i = 0; i < stations.size(); ++i) {
    lines.push_back(line_of(answers[i]));
    width = std::max(width, stations[i].name.size());
    state_width = std::max(state_width, lines.back().state.size());
  }
  const auto row = [&](const std::string& name, const Line& line) {
    return fmt::format("{:<{}}  {:<{}} {:>6} {:>6} {:>8} {:>7} {:>6}  {}\n", name, width,
                       line.state, state_width, line.time, line.marks, line.coverage, line.force,
                       line.missing, line.news);
  };
  std::string text =
      row("station", {"task", "time s", "marks", "cover %", "Fmax N", "lost %", "result"});
  for (std::size_t i = 0; i < stations.size(); ++i) {
    lines[i].news = shortened(lines[i].news);
    text += row(stations[i].name, lines[i]);
  }
  return text;
}

std::string stations_csv(const std::vector<Station>& stations,
                         const std::vector<StationAnswer>& answers) {
  std::string csv =
      "station,state,time_s,marks,coverage_percent,force_most_n,missing_percent,news\n";
  for (std::size_t i = 0; i < stations.size(); ++i) {
    const Line line = line_of(answers[i]);
    csv += fmt::format("{},{},{},{},{},{},{},{}\n", csv_cell(stations[i].name),
                       csv_cell(line.state), line.time, line.marks, line.coverage, line.force,
                       line.missing, csv_cell(line.news));
  }
  return csv;
}

std::string stations_json(const std::vector<Station>& stations,
                          const std::vector<StationAnswer>& answers) {
  json rows = json::array();
  for (std::size_t i = 0; i < stations.size(); ++i) {
    const Line line = line_of(answers[i]);
    rows.push_back(
        {{"name", stations[i].name},
         {"state", line.state},
         {"cells", {line.time, line.marks, line.coverage, line.force, line.missing, line.news}}});
  }
  return json_text(json{{"stations", rows}});
}

}  // namespace palpate
