// A target of headers alone needs one source.
int main() {}
