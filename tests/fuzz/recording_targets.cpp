// Recordings, their schemas, and samples of every type as they come from the wire.
#include <fastdds/dds/topic/TopicDataType.hpp>

#include <fstream>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>

#include "core/base/temporary_folder.hpp"
#include "core/config/yaml.hpp"
#include "core/dds/wire_type.hpp"
#include "core/model/model_file.hpp"
#include "core/model/recording_file.hpp"
#include "core/recording/cdr.hpp"
#include "core/recording/export.hpp"
#include "core/recording/recording_reader.hpp"
#include "core/recording/recording_writer.hpp"
#include "core/recording/recover.hpp"
#include "core/recording/type_book.hpp"
#include "core/recording/value_json.hpp"
#include "idl/idl_texts.hpp"
#include "tests/fuzz/targets.hpp"

namespace invar::fuzz {

namespace {

namespace fs = std::filesystem;
using recording::Value;

const char* const axis_state = "invar::stage::AxisState";

/// A recording of an axis: two channels, an attachment, a note, the ledger.
Bytes made_recording(recording::Compression compression, bool whole) {
  const TemporaryFolder folder{"invar-fuzz-seed"};
  const auto file = folder / "run.mcap";
  {
    recording::RecordingOptions options;
    options.chunks.compression = compression;
    options.chunks.bytes = 2048;
    recording::RecordingWriter writer{file, options};
    const auto& type = *recording::built_in_type(axis_state);
    const auto channel = writer.add_channel(
        {"cell/trial/stage_z/state", axis_state, std::string{type.idl}, "reliable", "", {}});
    for (std::uint32_t i = 0; i < 40; ++i) {
      Value value = Value::zero(*type.type);
      value.at("at.time_ns")->content = std::int64_t{1'000'000} * (i + 1);
      value.at("at.cycle")->content = std::uint64_t{i + 1};
      if (auto* enabled = value.at("enabled")) enabled->content = true;
      value.at("position")->content = 1e-6 * i;
      const auto payload = recording::encode(value);
      writer.write(channel, i + 1, Instant{1'000'000LL * (i + 1)}, Instant{1'000'000LL * (i + 1)}, payload);
    }
    const Bytes text = bytes_of("invar_cell: 1\n");
    writer.attach("cell.yaml", "application/yaml", text, Instant{1});
    writer.note({"about", {{"machine", "trial"}}});
    if (whole) writer.close();
  }
  std::ifstream stream{file, std::ios::binary};
  Bytes bytes{std::istreambuf_iterator<char>{stream}, {}};
  if (!whole) bytes.resize(bytes.size() / 2);
  return bytes;
}

void read_mcap(const Bytes&, const fs::path& file) {
  const auto opened = recording::Recording::open(file);
  (void)opened.ledger();
  auto stream = opened.messages();
  while (stream.next()) {
  }
  (void)recording::export_recording(opened, file.parent_path() / "tables");
  (void)recording::export_recording(opened, file.parent_path() / "lines", {{}, true, 64});
  (void)recording::recover(opened, file.parent_path() / "whole.mcap");
}

void read_mcap_for_model(const Bytes&, const fs::path& file) {
  static const auto model = model::read(config::Yaml::parse(
      "invar_model: 1\nplant: axis\ncolumns: {time: stage_z.state.at, position: stage_z.state.position,"
      " current: stage_z.state.current}\nparameters:\n  mass: {value: 3.2, unit: kg}\n"
      "  motor_constant: {value: 35, unit: N/A}\n  viscous_damping: {value: 20, unit: N s/m}\n",
      "model.yaml"));
  (void)model::read_recording(file, model);
}

std::vector<Bytes> zeros_of_every_type() {
  std::vector<Bytes> seeds;
  for (const auto& name : recording::built_in_type_names())
    seeds.push_back(recording::encode(Value::zero(*recording::built_in_type(name)->type)));
  return seeds;
}

/// Takes the bytes for a sample of every type, by the decoder that follows the IDL.
void decode_all(const Bytes& input, const fs::path&) {
  for (const auto& name : recording::built_in_type_names()) {
    const auto value = recording::decode(*recording::built_in_type(name)->type, input);
    if (value.ok()) (void)recording::to_json_line(recording::to_json(value.value()));
  }
}

/// The same by the generated type supports, as they take what arrives.
void deserialize_all(const Bytes& input, const fs::path&) {
  for (const auto& name : dds::WireTypes::all().names()) {
    const std::unique_ptr<eprosima::fastdds::dds::TopicDataType> support{
        dds::WireTypes::all().find(name)->make_support()};
    eprosima::fastrtps::rtps::SerializedPayload_t payload{static_cast<std::uint32_t>(input.size() + 1)};
    std::copy(input.begin(), input.end(), payload.data);
    payload.length = static_cast<std::uint32_t>(input.size());
    payload.encapsulation = CDR_LE;
    void* sample = support->createData();
    (void)support->deserialize(&payload, sample);
    support->deleteData(sample);
  }
}

void parse_schema(const Bytes& input, const fs::path&) {
  const std::string text{input.begin(), input.end()};
  const auto schema = recording::parse_idl(text, "schema");
  const Bytes zero(256, 0);
  for (const auto& [name, type] : schema.types) {
    (void)recording::decode(*type, zero);
    if (type->kind == recording::Kind::structure && type->values < 10'000) (void)Value::zero(*type);
  }
}

}  // namespace

std::vector<Target> recording_targets() {
  using recording::Compression;
  std::vector<Bytes> recordings;
  for (const auto compression : {Compression::none, Compression::lz4, Compression::zstd})
    recordings.push_back(made_recording(compression, true));
  recordings.push_back(made_recording(Compression::none, false));
  std::vector<Bytes> schemas;
  for (const auto& text : idl_texts()) schemas.push_back(bytes_of(std::string{text.text}));
  const std::vector<std::string> idl{"struct S {",        "};",         "long a[2][3];",
                                     "sequence<octet,9>", "module m {", "@unit(\"m\")"};
  return {{"mcap", ".mcap", recordings, {}, read_mcap},
          {"mcap_for_model", ".mcap", recordings, {}, read_mcap_for_model},
          {"idl", "", schemas, idl, parse_schema},
          {"cdr_by_idl", "", zeros_of_every_type(), {}, decode_all},
          {"cdr_from_wire", "", zeros_of_every_type(), {}, deserialize_all}};
}

}  // namespace invar::fuzz
