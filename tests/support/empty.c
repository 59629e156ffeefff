// Keeps the support library buildable before it has anything in it.
typedef int RfTestSupportIsNotEmpty;
