// `invar profiles`: the QoS profiles as a table, or as XML for programs of a plant's own.
#include <iostream>
#include <memory>
#include <sstream>

#include "core/dds/profile.hpp"
#include "tools/live/commands.hpp"
#include "tools/live/text_table.hpp"
#include "tools/report/escaped.hpp"

namespace invar::tools {

namespace {

struct ProfilesOptions {
  std::filesystem::path file;
  std::string xml;
};

std::string seconds(Duration time, const char* indent, const char* tag) {
  if (time.ns == 0) return "";
  std::ostringstream out;
  out << indent << '<' << tag << "><sec>" << time.ns / 1'000'000'000 << "</sec><nanosec>"
      << time.ns % 1'000'000'000 << "</nanosec></" << tag << ">\n";
  return out.str();
}

/// What the 2.x parser of Fast DDS takes; each policy once, in the order of its schema.
void write_fast_end(const dds::Profile& p, const char* end, std::ostream& out) {
  const bool writes = std::string{end} == "data_writer";
  out << "    <" << end << " profile_name=\"" << report::escaped(p.name) << "\">\n"
      << "      <topic>\n"
      << "        <historyQos><kind>" << (p.keep_all ? "KEEP_ALL" : "KEEP_LAST") << "</kind><depth>"
      << p.depth << "</depth></historyQos>\n"
      << "        <resourceLimitsQos><max_samples>" << p.depth * p.max_instances
      << "</max_samples><max_instances>" << p.max_instances << "</max_instances><max_samples_per_instance>"
      << p.depth << "</max_samples_per_instance></resourceLimitsQos>\n"
      << "      </topic>\n"
      << "      <qos>\n"
      << "        <reliability><kind>" << (p.reliable ? "RELIABLE" : "BEST_EFFORT")
      << "</kind></reliability>\n"
      << "        <durability><kind>"
      << (p.durability == dds::Durability::transient_local ? "TRANSIENT_LOCAL" : "VOLATILE")
      << "</kind></durability>\n";
  if (p.deadline.ns != 0)
    out << "        <deadline>\n" << seconds(p.deadline, "          ", "period") << "        </deadline>\n";
  if (p.lifespan.ns != 0)
    out << "        <lifespan>\n" << seconds(p.lifespan, "          ", "duration") << "        </lifespan>\n";
  if (p.lease.ns != 0) {
    const char* kind = p.liveliness == dds::Liveliness::automatic         ? "AUTOMATIC"
                       : p.liveliness == dds::Liveliness::manual_by_topic ? "MANUAL_BY_TOPIC"
                                                                          : "MANUAL_BY_PARTICIPANT";
    out << "        <liveliness>\n          <kind>" << kind << "</kind>\n"
        << seconds(p.lease, "          ", "lease_duration");
    if (writes) out << seconds(p.lease / 3, "          ", "announcement_period");
    out << "        </liveliness>\n";
  }
  out << "        <ownership><kind>" << (p.exclusive ? "EXCLUSIVE" : "SHARED") << "</kind></ownership>\n";
  if (writes && p.exclusive)
    out << "        <ownershipStrength><value>" << p.strength << "</value></ownershipStrength>\n";
  if (writes) out << "        <publishMode><kind>SYNCHRONOUS</kind></publishMode>\n";
  out << "        <data_sharing><kind>OFF</kind></data_sharing>\n"
      << "      </qos>\n"
      << "      <historyMemoryPolicy>DYNAMIC_REUSABLE</historyMemoryPolicy>\n"
      << "    </" << end << ">\n";
}

void write_fast(const dds::Profiles& profiles, std::ostream& out) {
  out << "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
         "<!-- QoS profiles of an Invar cell for Fast DDS 2.x. Register types without type information:\n"
         "     auto_fill_type_object(false), auto_fill_type_information(false). -->\n"
         "<dds xmlns=\"http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles\">\n"
         "  <profiles>\n";
  for (const auto& [name, profile] : profiles) {
    write_fast_end(profile, "data_writer", out);
    write_fast_end(profile, "data_reader", out);
  }
  out << "  </profiles>\n</dds>\n";
}

std::string iso(Duration time) {
  if (time.ns == 0) return "DURATION_INFINITY";
  return std::to_string(time.ns / 1'000'000'000) + "</sec><nanosec>" +
         std::to_string(time.ns % 1'000'000'000);
}

/// The OMG DDS-XML format (formal/2018-12-01), which Cyclone DDS's QoS provider reads.
void write_omg_end(const dds::Profile& p, const char* end, std::ostream& out) {
  const bool writes = std::string{end} == "datawriter_qos";
  const auto time = [&](const char* policy, const char* field, Duration value) {
    if (value.ns != 0)
      out << "        <" << policy << "><" << field << "><sec>" << iso(value) << "</nanosec></" << field
          << "></" << policy << ">\n";
  };
  out << "      <" << end << ">\n"
      << "        <reliability><kind>" << (p.reliable ? "RELIABLE" : "BEST_EFFORT")
      << "_RELIABILITY_QOS</kind></reliability>\n"
      << "        <durability><kind>"
      << (p.durability == dds::Durability::transient_local ? "TRANSIENT_LOCAL" : "VOLATILE")
      << "_DURABILITY_QOS</kind></durability>\n"
      << "        <history><kind>" << (p.keep_all ? "KEEP_ALL" : "KEEP_LAST") << "_HISTORY_QOS</kind>";
  if (!p.keep_all) out << "<depth>" << p.depth << "</depth>";
  out << "</history>\n"
      << "        <ownership><kind>" << (p.exclusive ? "EXCLUSIVE" : "SHARED")
      << "_OWNERSHIP_QOS</kind></ownership>\n";
  if (writes && p.exclusive)
    out << "        <ownership_strength><value>" << p.strength << "</value></ownership_strength>\n";
  time("deadline", "period", p.deadline);
  if (writes) time("lifespan", "duration", p.lifespan);
  if (p.lease.ns != 0) {
    const char* kind = p.liveliness == dds::Liveliness::automatic         ? "AUTOMATIC"
                       : p.liveliness == dds::Liveliness::manual_by_topic ? "MANUAL_BY_TOPIC"
                                                                          : "MANUAL_BY_PARTICIPANT";
    out << "        <liveliness><kind>" << kind << "_LIVELINESS_QOS</kind><lease_duration><sec>"
        << iso(p.lease) << "</nanosec></lease_duration></liveliness>\n";
  }
  out << "      </" << end << ">\n";
}

void write_omg(const dds::Profiles& profiles, std::ostream& out) {
  out << "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
         "<!-- QoS profiles of an Invar cell in the OMG's DDS-XML, for the QoS provider of Cyclone DDS. "
         "-->\n"
         "<dds xmlns=\"http://www.omg.org/spec/DDS-XML\">\n"
         "  <qos_library name=\"invar\">\n";
  for (const auto& [name, profile] : profiles) {
    out << "    <qos_profile name=\"" << report::escaped(name) << "\">\n";
    write_omg_end(profile, "datareader_qos", out);
    write_omg_end(profile, "datawriter_qos", out);
    out << "    </qos_profile>\n";
  }
  out << "  </qos_library>\n</dds>\n";
}

void print_profiles(const dds::Profiles& profiles) {
  TextTable table{{"profile", "reliability", "history", "durability", "deadline [ms]>", "lifespan [ms]>",
                   "lease [ms]>", "ownership", "for"}};
  const auto ms = [](Duration time) {
    return time.ns == 0 ? std::string{"-"} : number_text(static_cast<double>(time.ns) * 1e-6);
  };
  for (const auto& [name, p] : profiles)
    table.add({name, p.reliable ? "reliable" : "best effort",
               (p.keep_all ? "all, at most " : "last ") + std::to_string(p.depth),
               p.durability == dds::Durability::transient_local ? "transient local" : "volatile",
               ms(p.deadline), ms(p.lifespan), ms(p.lease), p.exclusive ? "exclusive" : "shared", p.purpose});
  table.print(std::cout);
}

}  // namespace

void add_profiles(CLI::App& program) {
  auto* command =
      program.add_subcommand("profiles", "Show QoS profiles, or write them as XML for other programs");
  command->footer(
      "Example: invar profiles deployment/profiles.yaml\n"
      "         invar profiles --xml fastdds > invar-profiles.xml\n"
      "Exit status: 0; 2 the file has faults");
  auto options = std::make_shared<ProfilesOptions>();
  command->add_option("file", options->file,
                      "the profiles file; otherwise the profiles that ship with Invar");
  command->add_option("--xml", options->xml, "write XML: `fastdds` (2.x) or `cyclone` (OMG DDS-XML)")
      ->check(CLI::IsMember({"fastdds", "cyclone"}));
  command->callback([options] {
    const auto profiles =
        options->file.empty() ? dds::standard_profiles() : dds::load_profiles(options->file);
    if (options->xml == "fastdds") {
      write_fast(profiles, std::cout);
    } else if (options->xml == "cyclone") {
      write_omg(profiles, std::cout);
    } else {
      print_profiles(profiles);
    }
  });
}

}  // namespace invar::tools
