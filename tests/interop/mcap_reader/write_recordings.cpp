// Writes recordings of every type of the cell and of the tests' own, packed each way, and beside each the values that a
// reader must find. Call: write_recordings FOLDER
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>

#include "core/recording/cdr.hpp"
#include "core/recording/recording_writer.hpp"
#include "core/recording/type_book.hpp"
#include "core/recording/value_json.hpp"
#include "tests/unit/recording/everything.hpp"

namespace invar::recording {
namespace {

/// Any value of the type; sequences get up to three elements.
void randomise(Value& value, std::mt19937_64& random) {
  const Type& type = *value.type;
  if (type.kind == Kind::sequence) {
    const std::size_t size = random() % (type.bound == 0 ? 4 : std::min<std::size_t>(type.bound + 1, 4));
    if (type.element->kind == Kind::octet)
      value.content = Bytes(size);
    else
      value.content = std::vector<Value>(size, Value::zero(*type.element));
  }
  if (auto* list = std::get_if<std::vector<Value>>(&value.content)) {
    for (Value& each : *list) randomise(each, random);
  } else if (auto* octets = std::get_if<Bytes>(&value.content)) {
    for (auto& each : *octets) each = static_cast<std::uint8_t>(random());
  } else if (type.kind == Kind::boolean) {
    value.content = random() % 2 == 1;
  } else if (type.kind == Kind::enumeration) {
    value.content = std::int64_t{type.enumerators[random() % type.enumerators.size()].second};
  } else if (type.kind == Kind::float64) {
    value.content = std::uniform_real_distribution<double>{-1.0, 1.0}(random);
  } else if (type.kind == Kind::float32) {
    value.content = static_cast<double>(std::uniform_real_distribution<float>{-1.0F, 1.0F}(random));
  } else if (type.kind == Kind::string) {
    value.content =
        std::string(random() % std::min<std::size_t>(type.bound == 0 ? 9 : type.bound + 1, 9), 'a');
  } else if (type.kind == Kind::uint64) {
    value.content = random();
  } else if (type.kind == Kind::int64) {
    value.content = static_cast<std::int64_t>(random());
  } else if (std::holds_alternative<std::uint64_t>(value.content)) {
    value.content = random() % 200;
  } else if (std::holds_alternative<std::int64_t>(value.content)) {
    value.content = static_cast<std::int64_t>(random() % 200) - 100;
  }
}

/// The text without its preprocessor lines.
std::string everything_idl() {
  std::ifstream file{INVAR_TEST_DATA "/recording/everything.idl"};
  std::string text;
  for (std::string line; std::getline(file, line);)
    if (!line.starts_with('#')) text += line + "\n";
  return text;
}

class Writer {
 public:
  Writer(const std::string& stem, Compression compression)
      : writer_{stem + ".mcap", options(compression)}, expected_{stem + ".jsonl"} {}

  std::uint16_t channel(const std::string& topic, const std::string& type, const std::string& idl) {
    return writer_.add_channel({topic, type, idl, "reliability: reliable", "", {}});
  }

  void add(std::uint16_t channel, const std::string& topic, const Value& value, const Bytes& payload) {
    ++sequence_;
    const Instant time{1'763'763'828'000'000'000 + sequence_ * 1'000'001LL};
    writer_.write(channel, sequence_, time, time - Duration{777}, payload);
    expected_ << to_json_line({{"topic", topic},
                               {"sequence", sequence_},
                               {"log_time", std::to_string(time.ns)},
                               {"publish_time", std::to_string(time.ns - 777)},
                               {"message", to_json(value, 1000)}})
              << '\n';
  }

  bool close() {
    writer_.attach("cell.yaml", "application/yaml", Bytes{'c', 'e', 'l', 'l'}, {1});
    return writer_.close();
  }

 private:
  static RecordingOptions options(Compression compression) {
    RecordingOptions options;
    options.chunks = {compression, 1, 20'000};
    return options;
  }

  RecordingWriter writer_;
  std::ofstream expected_;
  std::uint32_t sequence_ = 0;
};

int write_all(const std::string& folder) {
  const auto seed = std::random_device{}();
  std::cout << "seed " << seed << '\n';
  std::mt19937_64 random{seed};
  const std::string idl = everything_idl();
  const auto everything = parse_idl(idl, "everything.idl").find("probe::Everything");
  for (const auto compression : {Compression::none, Compression::lz4, Compression::zstd}) {
    const std::string name{compression == Compression::none ? "plain" : name_of(compression)};
    Writer writer{folder + "/" + name, compression};
    const auto own = writer.channel("probe", "probe::Everything", idl);
    for (int i = 0; i < 200; ++i) {
      using eprosima::fastcdr::Cdr;
      const auto payload =
          serialised(random_sample(random), i % 2 == 0 ? Cdr::LITTLE_ENDIANNESS : Cdr::BIG_ENDIANNESS);
      writer.add(own, "probe", decode(*everything, payload).value(), payload);
    }
    for (const std::string& type_name : built_in_type_names()) {
      const BuiltInType& type = *built_in_type(type_name);
      const auto channel = writer.channel("cell/" + type_name, type_name, std::string{type.idl});
      for (int i = 0; i < 20; ++i) {
        Value value = Value::zero(*type.type);
        randomise(value, random);
        writer.add(channel, "cell/" + type_name, value,
                   encode(value, i % 2 == 0 ? std::endian::little : std::endian::big));
      }
    }
    if (!writer.close()) return 1;
  }
  return 0;
}

}  // namespace
}  // namespace invar::recording

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "call: write_recordings FOLDER\n";
    return 2;
  }
  return invar::recording::write_all(argv[1]);
}
