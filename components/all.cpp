#include "components/all.hpp"

namespace invar {

void add_all_components(Registry& registry) { (void)registry; }

}  // namespace invar
