#include "tools/commands/remote_options.hpp"

#include "core/base/name.hpp"

namespace invar::tools {

void add_remote_options(CLI::App& command, DeployOptions& options) {
  command.add_option("--prefix", options.prefix, "folder on each PC; the cell's own is below it")
      ->capture_default_str();
  command.add_option("--user", options.user, "user of the service; made where it is missing")
      ->capture_default_str();
  command.add_option("--identity", options.identity, "private key for ssh")->check(CLI::ExistingFile);
  command.add_option("--ssh-config", options.ssh_config, "configuration file for ssh")
      ->check(CLI::ExistingFile);
  command.add_option("--ssh-port", options.ssh_port, "port of ssh on all PCs; otherwise as `hosts` says")
      ->check(CLI::Range(1, 65535));
}

void check_remote_options(const DeployOptions& options) {
  const std::string prefix = options.prefix.string();
  bool plain = options.prefix.is_absolute() && prefix.size() <= 200;
  for (std::size_t at = 0; at < prefix.size(); at += longest_identifier)
    plain = plain && !flaw_of_identifier(prefix.substr(at, longest_identifier), "/._-");
  if (!plain)
    throw InputError{"--prefix",
                     "`" + printable(prefix) + "` is no absolute path of letters, digits, `.`, `_` and `-`",
                     "name a folder such as /opt/invar"};
  if (const auto wrong = flaw_of_identifier(options.user, "-"))
    throw InputError{"--user", "`" + printable(options.user) + "` is no user: it " + wrong->what,
                     wrong->mend};
}

}  // namespace invar::tools
