// Reads joint states from an MCAP log with the C++ library of the format, for read_mcap.py.
//
//     read_mcap LOG NAMES ROWS
//
// NAMES is the count of joints. Decodes what a typed reader of ROS 2 would: the stamp and the positions, by a decoder for this one message.
// Writes rows of seconds since BEGIN and positions to the file ROWS, and prints the seconds and the processor time of the reading.

#define MCAP_IMPLEMENTATION
#include <mcap/reader.hpp>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <vector>

static const int64_t BEGIN = 1763000000000000000;

// A value at a place that is aligned behind the four bytes of the encoding.
template <typename T>
static T take(const std::byte* data, size_t& at) {
  at = 4 + (at - 4 + sizeof(T) - 1) / sizeof(T) * sizeof(T);
  T value;
  std::memcpy(&value, data + at, sizeof(T));
  at += sizeof(T);
  return value;
}

int main(int count, char** words) {
  if (count != 4) return 2;
  const size_t joints = std::strtoul(words[2], nullptr, 10);
  const auto begin = std::chrono::steady_clock::now();
  mcap::McapReader reader;
  if (!reader.open(words[1]).ok()) return 1;
  std::vector<double> rows;
  const auto problem = [](const mcap::Status& status) { std::fprintf(stderr, "%s\n", status.message.c_str()); };
  mcap::ReadMessageOptions options;
  options.readOrder = mcap::ReadMessageOptions::ReadOrder::FileOrder;
  for (const auto& view : reader.readMessages(problem, options)) {
    if (view.channel->topic != "/joint_states") continue;
    const std::byte* data = view.message.data;
    size_t at = 4;
    const auto sec = take<int32_t>(data, at);
    const auto nanosec = take<uint32_t>(data, at);
    at += take<uint32_t>(data, at);  // the frame's name
    const auto names = take<uint32_t>(data, at);
    for (uint32_t i = 0; i < names; ++i) at += take<uint32_t>(data, at);
    if (take<uint32_t>(data, at) != joints) return 1;
    rows.push_back(static_cast<double>(sec * INT64_C(1000000000) + nanosec - BEGIN) / 1e9);
    for (size_t i = 0; i < joints; ++i) rows.push_back(take<double>(data, at));
  }
  reader.close();
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
  const double busy = static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
  std::FILE* out = std::fopen(words[3], "wb");
  if (!out || std::fwrite(rows.data(), sizeof(double), rows.size(), out) != rows.size()) return 1;
  std::fclose(out);
  std::printf("%.6f %.6f\n", seconds.count(), busy);
}
