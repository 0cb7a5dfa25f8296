// SPDX-License-Identifier: Apache-2.0
// connection.ts: why a page is not connected. A browser does not tell why a WebSocket was refused, so
// the same server is asked by plain HTTP.

/** In words; "" if nothing is known. @param search  of the page's address, with the token */
export async function refusal_words(search: string, host: string): Promise<string> {
  let status;
  try {
    ({ status } = await fetch(`/verdict${search}`, { cache: "no-store" }));
  } catch {
    return `Nothing answers at ${host}: viewer_node has ended, or the network is down.`;
  }
  if (status === 401) return "The address lacks the token, or has an old one: open the address that viewer_node printed, with ?token=….";
  if (status === 403) return `The server does not serve pages under the name ${host} (viewer_node --allow-host).`;
  return status === 200 ? "The server runs, but accepts no further page: as many viewers as it allows are connected already." : "";
}
