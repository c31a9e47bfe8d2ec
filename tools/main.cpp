// invar: the one program that people type; its subcommands stand in tools/commands/, one a file.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <iostream>
#include <new>
#include <string>
#include <string_view>

#include "core/base/fault.hpp"
#include "core/base/input_file.hpp"
#include "core/base/name.hpp"
#include "tools/command.hpp"
#include "tools/live/commands.hpp"
#include "tools/live/terminal.hpp"
#include "tools/wrong_call.hpp"

namespace {

constexpr const char* version = "invar " INVAR_VERSION;

int run(int argc, char** argv) {
  CLI::App program{
      "Invar: a component framework for industrial cells that must place things to the micrometre.", "invar"};
  program.require_subcommand(1);
  program.set_version_flag("--version", version);
  invar::tools::add_about(program);
  invar::tools::add_backup(program);
  invar::tools::add_bridge(program);
  invar::tools::add_calibrate(program);
  invar::tools::add_check(program);
  invar::tools::add_completion(program);
  invar::tools::add_deploy(program);
  invar::tools::add_diagnose(program);
  invar::tools::add_doctor(program);
  invar::tools::add_echo(program);
  invar::tools::add_export(program);
  invar::tools::add_hz(program);
  invar::tools::add_job(program);
  invar::tools::add_keys(program);
  invar::tools::add_latency_test(program);
  invar::tools::add_lifecycle(program);
  invar::tools::add_measure(program);
  invar::tools::add_metrics(program);
  invar::tools::add_new(program);
  invar::tools::add_param(program);
  invar::tools::add_predict(program);
  invar::tools::add_profiles(program);
  invar::tools::add_record(program);
  invar::tools::add_recording(program);
  invar::tools::add_replay(program);
  invar::tools::add_restore(program);
  invar::tools::add_run(program);
  invar::tools::add_simulate(program);
  invar::tools::add_status(program);
  invar::tools::add_top(program);
  invar::tools::add_topics(program);
  invar::tools::add_types(program);
  invar::tools::add_units(program);
  try {
    program.parse(argc, argv);
  } catch (const CLI::RuntimeError& end) {
    return end.get_exit_code();
  } catch (const CLI::ParseError& error) {
    // Help and version come this way too, with status 0; every real fault of the call is status 2.
    if (error.get_exit_code() == 0) return program.exit(error);
    if (std::find(argv + 1, argv + argc, std::string_view{"--version"}) !=
        argv + argc) {  // behind any command
      std::cout << version << '\n';
      return 0;
    }
    std::cerr << "invar: "
              << invar::printable(invar::tools::wrong_call(program, {argv + 1, argv + argc}, error)) << '\n';
    return 2;
  } catch (const invar::InputError& error) {
    for (const auto& fault : error.faults()) std::cerr << fault.line() << '\n';
    return 2;
  } catch (const std::bad_alloc&) {
    const std::string file = invar::last_input();
    std::cerr << (file.empty() ? "invar" : invar::printable(file))
              << ": needs more memory than this PC gives; name a smaller file, or part of it\n";
    return 2;
  } catch (const std::filesystem::filesystem_error& error) {
    std::cerr << invar::printable(error.path1().string()) << ": " << error.code().message()
              << "; check the path and its permissions\n";
    return 2;
  } catch (const std::exception& error) {
    std::cerr << "invar: " << invar::printable(error.what()) << '\n';
    return 1;
  }
  return 0;
}

/// Ends the program. Static objects stay as they are: the destructor of Fast DDS's factory sleeps 100 ms, with no participant
/// left that it could wait for. A leak is looked for after `main` alone.
int leave(int status) {
#ifndef __SANITIZE_ADDRESS__
  std::fflush(nullptr);
  std::_Exit(status);
#endif
  return status;
}

}  // namespace

int main(int argc, char** argv) {
  const invar::tools::LettersOnly out{std::cout}, err{std::cerr};
  const int status = run(argc, argv);
  if (std::cout.flush()) return leave(status);
  // A full disk or a closed pipe: who reads the output must not take nothing for an answer.
  std::cerr << "invar: standard output cannot be written; look for a full disk or a closed pipe\n";
  return leave(status == 0 ? 1 : status);
}
